"""What it is worth to wait: the hybrid with a fixed lag of 0, 25 and 50 ms against the true friction of the rig.

    python performance/fixed_lag.py [--run FOLDER] [--epochs 20]

Reads the recordings, the hyperparameters and the truth of a finished run, the present folder by default, and trains the
hybrid anew for each lag, all with the same number of epochs.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from true_friction import EVENT_WINDOW_S, header, line

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.recordings.files import read_json
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.recordings.truth import known_truth
from cylinder_friction.signals.motion import near_events

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array

CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
LAGS_S = (0.0, 0.025, 0.05)


def main() -> None:
    """Print one row per lag, one column per condition."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    parser.add_argument("--epochs", type=int, default=20)
    arguments = parser.parse_args()
    data, chosen = arguments.run / "data", read_json(arguments.run / "models/hybrid/chosen.json")
    parts = {
        role: read_recordings(data / "processed" / role) for role in ("train", "validation", "calibration", "test")
    }
    truth_n = known_truth(str(data / "raw/rig_truth"), parts["test"])
    tracker = OffsetTracker.from_dict(read_json(data / "processed/estimators.json")["offset_tracker"])
    print("mean absolute error [% of mean |true friction| of the condition], and near events [N]")
    print(f"{header(sorted({each.metadata.condition for each in parts['test']}))}{'events':>9}")
    for lag_s in LAGS_S:
        hybrid = HybridEstimator(
            CYLINDER,
            "force_balance",
            Architecture(chosen["layers"], chosen["nodes"], chosen["dropout"], chosen["learning_rate"]),
            TrainingPlan(arguments.epochs, patience=12, schedule="cosine"),
            ForestPlan(chosen["forest_trees"], chosen["forest_depth"], 15_000, 10),
            seed=1,
            tracker=tracker,
            lag_s=lag_s,
        ).fit(parts["train"], parts["validation"], parts["calibration"])
        rows: dict[str, list[tuple[Array, Array]]] = {}
        events = []
        for recording in parts["test"]:
            usable, true_n = recording.usable(), truth_n[recording.name]
            error_n = np.abs(hybrid.estimate(recording) - true_n)
            rows.setdefault(recording.metadata.condition, []).append((error_n[usable], np.abs(true_n)[usable]))
            near = near_events(recording.column("velocity_m_s"), round(EVENT_WINDOW_S / recording.sample_time_s))
            events.append(error_n[near & usable])
        print(f"{line(f'lag of {1e3 * lag_s:g} ms', rows)}{np.concatenate(events).mean():9.1f}", flush=True)


if __name__ == "__main__":
    main()
