"""The command ``golden``: train the small model of the golden trajectories, record them anew, or check them."""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.params.checking import Params, load_params
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.stages._stage import PROCESSED_FOLDERS
from cylinder_friction.testing.golden import (
    MODEL_FOLDER,
    golden_samples,
    read_trajectories,
    trace,
    write_trajectory,
)

ARCHITECTURE = Architecture(layers=1, nodes=16, dropout=0.0, learning_rate=5e-3)
PLAN = TrainingPlan(epochs=40, patience=40, sequence_length=400, burn_in=50, batch_size=16, schedule="cosine")
FOREST = ForestPlan(trees=16, depth=6, rows=20_000, leaf=40)


def train_golden_model(folder: Path, params: Params, inputs: Sequence[str] | None = None) -> None:
    """Train the small model of the golden trajectories on the first training recording of each condition.

    Its inputs are those of the pipeline's estimators, whose position load and offset tracker it has too, or others.
    """
    from cylinder_friction.stages._training import LearningData  # PyTorch

    data = LearningData.read()
    firsts = {recording.metadata.condition: recording for recording in reversed(data.train)}
    hybrid = HybridEstimator(
        params.cylinder,
        "force_balance",
        ARCHITECTURE,
        PLAN,
        FOREST,
        inputs=inputs or data.inputs,
        tracker=None if inputs else data.tracker,
        position_load=None if inputs else data.position_load,
    )
    hybrid.fit([firsts[condition] for condition in sorted(firsts)], data.validation)
    hybrid.save(folder / MODEL_FOLDER)


def record_golden(folder: Path) -> str:
    """Record every trajectory anew with the model in ``folder``; returns one line per trajectory."""
    model = load_estimator(folder / MODEL_FOLDER).step_model()
    lines = []
    for name, samples in golden_samples(read_stored(PROCESSED_FOLDERS["test"]), model.inputs).items():
        write_trajectory(folder, name, trace(model, samples))
        lines.append(f"{name}: {len(samples)} samples")
    return "\n".join(lines)


def check_golden(folder: Path) -> tuple[str, bool]:
    """Compare the compiled step's outputs with the recorded trajectories.

    Returns:
        A line per trajectory, and whether every number and every flag is the same bit for bit.
    """
    model = load_estimator(folder / MODEL_FOLDER).step_model()
    lines, same = [], True
    for name, golden in read_trajectories(folder).items():
        now = trace(model, golden.samples)
        difference_n = float(np.abs(now.newtons - golden.newtons).max())
        other = int(np.count_nonzero(now.flags != golden.flags))
        same &= difference_n == 0.0 and other == 0
        lines.append(f"{name}: python differs by {difference_n:.3g} N and in {other} flags")
    return "\n".join(lines), same


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parts = parser.add_subparsers(dest="what", required=True)
    for name, words in (
        ("train", "train the trajectories' small model anew; afterwards run `record`"),
        ("record", "record the trajectories anew from the test recordings"),
        ("check", "compare the outputs of the Python step with the recorded ones"),
    ):
        part = parts.add_parser(name, help=words, description=f"{words[0].upper()}{words[1:]}.")
        part.add_argument("--folder", type=Path, default=Path("tests/golden"))
        if name == "train":
            part.add_argument("--inputs", nargs="+", help="columns of a sample; default: the pipeline's")


def run(options: argparse.Namespace) -> int:
    if options.what == "train":
        train_golden_model(options.folder, load_params(), options.inputs)
    elif options.what == "record":
        print(record_golden(options.folder))
    else:
        report, same = check_golden(options.folder)
        print(report)
        return 0 if same else 1
    return 0
