"""The sequence graph in ONNX Runtime."""

from pathlib import Path

from cylinder_friction.deployment.onnx_graphs.export import export_model
from cylinder_friction.deployment.onnx_graphs.stream import OnnxSequence, open_sequence
from cylinder_friction.realtime.model import StepModel


class OnnxRecordings:
    """One call for all samples, each from a fresh state."""

    name = "onnx_sequence"
    steps = False

    def open(self, model: StepModel, folder: Path) -> OnnxSequence:
        path = folder / "sequence.onnx"
        return open_sequence(path if path.exists() else export_model(model, folder).sequence)


RUNTIME = OnnxRecordings()
