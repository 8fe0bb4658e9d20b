"""How near the load identified from position is to the true one, on a finished run of the rig with a crane.

    make params ARGS="record=boom ingest=rig_boom" && dvc repro offset
    python performance/identified_load.py [--run FOLDER]

First with each session's own load, as ``label`` takes it off; then with that of all training sessions and each
session's sensor offset, as ``offset`` does. Prints, for each condition and for all: what the crane's load reaches;
identified less true load, its mean and its standard deviation within a recording; the label's mean absolute error, the
same less the mean error of all rows, and in how many rows the stated uncertainty holds it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from cylinder_friction.recordings.columns import ALL_CONDITIONS, LOAD_FORCE, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.splits import ROLES
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.recordings.truth import read_truth


def main() -> None:
    """Print both tables of one run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    run = parser.parse_args().run
    for title, folders in (("each session's own load", ("labelled",)), ("one load, offsets taken off", ROLES)):
        print(f"{title}\ncondition  load up to     off by    varying     label  less mean  within stated")
        print_table(run, folders)


def print_table(run: Path, folders: tuple[str, ...]) -> None:
    """Print one line per condition, of the recordings in these folders."""
    columns: dict[str, list[np.ndarray]] = {}
    for recording in (each for folder in folders for each in read_recordings(run / "data/processed" / folder)):
        truth, usable = read_truth(run / "data/raw/rig_truth", recording), recording.usable()
        if truth is None or LOAD_FORCE not in truth.columns:
            raise SystemExit(f"{run}: the true load of {recording.name} is not there; give a run of record=boom")
        load_n = truth[LOAD_FORCE].to_numpy()
        off_n, label_n = recording.column(LOAD_FORCE) - load_n, recording.column("friction_n") - truth["friction_n"]
        varying_n = off_n - off_n[usable].mean()
        rows = np.array([np.abs(load_n), off_n, varying_n**2, label_n, recording.column(UNCERTAINTY_COLUMN)])[:, usable]
        for name in (recording.metadata.condition, ALL_CONDITIONS):
            columns.setdefault(name, []).append(rows)
    mean_n = np.concatenate(columns[ALL_CONDITIONS], axis=1)[3].mean()
    for name, of in sorted(columns.items()):
        load_n, off_n, variance, label_n, stated_n = np.concatenate(of, axis=1)
        within = 100.0 * np.mean(np.abs(label_n) <= stated_n)
        print(f"{name:9}{load_n.max():8.0f} N{off_n.mean():+9.1f} N{np.sqrt(variance.mean()):9.1f} N", end="")
        print(f"{np.abs(label_n).mean():8.1f} N{np.abs(label_n - mean_n).mean():9.1f} N{within:13.0f} %")


if __name__ == "__main__":
    main()
