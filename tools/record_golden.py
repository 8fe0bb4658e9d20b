"""Record the golden trajectories anew from the test recordings, after a change of the step that is meant.

    python tools/record_golden.py                                   # with the model that is there
    python tools/record_golden.py tests/golden/learns_offset        # those of another folder
    python tools/record_golden.py --train                           # train the small model anew first
    python tools/record_golden.py --train --inputs position_m oil_temperature_c -- tests/golden/pressure_free

Run it where ``dvc repro`` has run. ``pytest tests/contracts`` compares every runtime with the recorded trajectories.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.params.checking import load_params
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.stages._stage import PROCESSED_FOLDERS
from cylinder_friction.stages._training import LearningData
from cylinder_friction.testing.golden import MODEL_FOLDER, golden_samples, trace, write_trajectory

ARCHITECTURE = Architecture(layers=1, nodes=16, dropout=0.0, learning_rate=5e-3)
PLAN = TrainingPlan(epochs=40, patience=40, sequence_length=400, burn_in=50, batch_size=16, schedule="cosine")
FOREST = ForestPlan(trees=16, depth=6, rows=20_000, leaf=40)


def train_model(folder: Path, inputs: Sequence[str] | None = None) -> None:
    """Train the trajectories' small model on the first training recording of each condition.

    Its inputs are those of the pipeline's estimators, whose position load and offset tracker it has too, or others.
    """
    data = LearningData.read()
    firsts = {recording.metadata.condition: recording for recording in reversed(data.train)}
    hybrid = HybridEstimator(
        load_params().cylinder,
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


def record(folder: Path) -> None:
    """Record every trajectory with the model in ``folder``, and print a line for each."""
    model = load_estimator(folder / MODEL_FOLDER).step_model()
    for name, samples in golden_samples(read_stored(PROCESSED_FOLDERS["test"]), model.inputs).items():
        write_trajectory(folder, name, trace(model, samples))
        print(f"{name}: {len(samples)} samples")


def main() -> None:
    """Train, if asked to, and record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("tests/golden"))
    parser.add_argument("--train", action="store_true", help="train the small model anew first")
    parser.add_argument("--inputs", nargs="+", help="columns of a sample of the new model; default: the pipeline's")
    given = parser.parse_args()
    if given.train:
        train_model(given.folder, given.inputs)
    record(given.folder)


if __name__ == "__main__":
    main()
