"""How near LuGre, identified on the training recordings, comes to the best parameters for the held-out ones.

Reads ``data/processed/test`` and ``models/lugre``, searches LuGre's parameters with a larger budget directly on the
held-out recordings of the test that LuGre was identified on, and prints both errors against the label and their
ratio. Run from the repository's root after ``dvc repro``:

    .venv/bin/python benchmarks/lugre_best_possible.py
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.friction_models import SearchEffort
from cylinder_friction.recordings import Recording, read_recordings


def error_percent(estimator: LugreEstimator, recordings: list[Recording]) -> float:
    """Returns mean absolute error over mean absolute label of all usable rows, in percent."""
    errors, labels = [], []
    for recording in recordings:
        usable, label = recording.usable(), recording.column("friction_n")
        errors.append(np.abs(estimator.estimate(recording) - label)[usable])
        labels.append(np.abs(label)[usable])
    return 100.0 * float(np.concatenate(errors).mean() / np.concatenate(labels).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", type=Path, default=Path("models/lugre"))
    parser.add_argument("--recordings", type=Path, default=Path("data/processed/test"))
    parser.add_argument("--population", type=int, default=20)
    parser.add_argument("--generations", type=int, default=100)
    parser.add_argument("--restarts", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1001)
    arguments = parser.parse_args()
    print("model            identified %   best possible %   ratio   (MAE / mean |friction|, against the label)")
    for kind in ("lugre", "pressure_lugre"):
        estimator = FrictionEstimator.load(arguments.models / kind)
        assert isinstance(estimator, LugreEstimator)
        recordings = [
            recording
            for recording in read_recordings(arguments.recordings)
            if recording.metadata.test == estimator.test
        ]
        effort = SearchEffort(
            arguments.seed, arguments.population, arguments.generations, len(recordings), arguments.restarts
        )
        identified = error_percent(estimator, recordings)
        best = min(estimator.best_possible(recordings, effort).error_percent, identified)
        print(f"{kind:16s} {identified:12.3f} {best:17.3f} {identified / best:7.3f}", flush=True)


if __name__ == "__main__":
    main()
