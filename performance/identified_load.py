"""How near the load identified from position is to the true one, on a finished run of the rig with a crane.

    make params ARGS="record=boom ingest=rig_boom" && dvc repro label
    python performance/identified_load.py [--run FOLDER]

Prints, for each condition and for all: what the crane's load reaches; identified less true load, its mean and its
standard deviation within a session; the label's mean absolute error, and how much of it the stated uncertainty holds.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from cylinder_friction.recordings.columns import ALL_CONDITIONS, LOAD_FORCE, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.recordings.truth import read_truth


def main() -> None:
    """Print the table of one run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    run = parser.parse_args().run
    rows: dict[str, list[tuple[float, ...]]] = {}
    for recording in read_recordings(run / "data/processed/labelled"):
        truth, usable = read_truth(run / "data/raw/rig_truth", recording), recording.usable()
        if truth is None or LOAD_FORCE not in truth.columns:
            raise SystemExit(f"{run}: the true load of {recording.name} is not there; give a run of record=boom")
        load_n = truth[LOAD_FORCE].to_numpy()
        wrong_n = (recording.column(LOAD_FORCE) - load_n)[usable]
        label_n = np.abs(recording.column("friction_n") - truth["friction_n"].to_numpy())[usable]
        held = label_n <= recording.column(UNCERTAINTY_COLUMN)[usable]
        row = (np.abs(load_n).max(), wrong_n.mean(), wrong_n.std(), label_n.mean(), 100.0 * held.mean())
        for name in (recording.metadata.condition, ALL_CONDITIONS):
            rows.setdefault(name, []).append(row)
    print("condition  load up to     off by    varying     label  within stated")
    for name, of in sorted(rows.items()):
        most, mean, varying, label, held = np.mean(of, axis=0)
        print(f"{name:9}{most:8.0f} N{mean:+9.1f} N{varying:9.1f} N{label:8.1f} N{held:12.0f} %")


if __name__ == "__main__":
    main()
