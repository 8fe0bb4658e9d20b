"""How near LuGre, identified on the training recordings, comes to the best parameters there are.

Reads ``data/processed`` and ``models/lugre``. For the training recordings, all recordings and the held-out recordings
of the condition that LuGre was identified on, it searches LuGre's parameters with a larger budget directly on those
recordings, and prints both errors against the label and their ratio. On the training recordings the ratio shows how
good the search was. On the others it holds, besides, what one session differs from another (temperature, drift of
friction, how often and how long the piston rested), to which parameters fitted on that session alone can bend. A
budget below the default makes the best worse and the ratio flattering. Run from the repository's root after
``dvc repro``:

    .venv/bin/python performance/lugre_best_possible.py
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.friction_models.identification.procedure import SearchEffort
from cylinder_friction.recordings.storage import read_recordings

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording

ROLES = ("train", "validation", "test")


def error_percent(estimator: LugreEstimator, recordings: list[Recording]) -> float:
    """Return mean absolute error over mean absolute label of all usable rows, in percent."""
    errors, labels = [], []
    for recording in recordings:
        usable, label = recording.usable(), recording.column("friction_n")
        errors.append(np.abs(estimator.estimate(recording) - label)[usable])
        labels.append(np.abs(label)[usable])
    return 100.0 * float(np.concatenate(errors).mean() / np.concatenate(labels).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", type=Path, default=Path("models/lugre"))
    parser.add_argument("--processed", type=Path, default=Path("data/processed"))
    parser.add_argument("--roles", nargs="+", default=["train", "all", "test"])
    parser.add_argument("--kinds", nargs="+", default=["lugre", "pressure_lugre"])
    parser.add_argument("--population", type=int, default=20)
    parser.add_argument("--generations", type=int, default=100)
    parser.add_argument("--restarts", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1001)
    arguments = parser.parse_args()
    print("model            recordings   identified %   best possible %   ratio   (MAE / mean |friction|, label)")
    for kind in arguments.kinds:
        estimator = load_estimator(arguments.models / kind)
        assert isinstance(estimator, LugreEstimator)
        for role in arguments.roles:
            folders = ROLES if role == "all" else (role,)
            everything = [each for folder in folders for each in read_recordings(arguments.processed / folder)]
            recordings = [recording for recording in everything if recording.metadata.condition == estimator.condition]
            effort = SearchEffort(
                arguments.seed, arguments.population, arguments.generations, len(recordings), arguments.restarts
            )
            identified = error_percent(estimator, recordings)
            best = min(estimator.best_possible(recordings, effort).error_percent, identified)
            print(f"{kind:16s} {role:10s} {identified:14.3f} {best:17.3f} {identified / best:7.3f}", flush=True)


if __name__ == "__main__":
    main()
