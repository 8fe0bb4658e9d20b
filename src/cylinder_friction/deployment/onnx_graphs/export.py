"""A fitted estimator as two ONNX files: one for a sample at a time, one for a recording at once."""

from dataclasses import dataclass
from pathlib import Path

from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.onnx_graphs.step import step_graph
from cylinder_friction.deployment.rendering import model_hash
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.files import write_bytes

STEP_FILE = "step.onnx"
SEQUENCE_FILE = "sequence.onnx"


@dataclass(frozen=True)
class ExportedOnnx:
    """The written files."""

    # The two files
    step: Path
    sequence: Path
    model: str  # SHA-256 of every number that a step uses; both files carry it
    nodes: int  # Operators in the step graph


def export_onnx(estimator: FrictionEstimator, folder: Path) -> ExportedOnnx:
    """Write ``step.onnx`` and ``sequence.onnx`` into ``folder``; equal estimators make equal bytes.

    Args:
        estimator: Fitted; any with a real-time step.
        folder: Created if it does not exist.

    Raises:
        NotFittedError: There is nothing fitted or loaded yet.
        ValueError: The estimator has no real-time step.
    """
    return export_model(estimator.step_model(), folder)


def export_model(model: StepModel, folder: Path) -> ExportedOnnx:
    """Write both files of a step model."""
    graphs = {STEP_FILE: step_graph(model), SEQUENCE_FILE: sequence_graph(model)}
    for name, graph in graphs.items():
        write_bytes(folder / name, graph.SerializeToString(deterministic=True))
    return ExportedOnnx(
        folder / STEP_FILE, folder / SEQUENCE_FILE, model_hash(model), len(graphs[STEP_FILE].graph.node)
    )
