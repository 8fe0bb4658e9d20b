"""What knowing the sensors' offset is worth: errors of label and hybrid against the true friction of the rig.

    python performance/known_offset.py [--run FOLDER]

Reads the trained hybrid, the split and the truth of a finished run, the present folder by default. The offset of each
test session is identified without truth, given the training sessions. ``cold``: the estimate as it is; ``warm``: that
of each session's later recordings, less the offset identified in its first one.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.labelling.sensor_offset import fit_offset_model
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.recordings.truth import known_truth

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording

CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)


def main() -> None:
    """Print the errors, one row per way of knowing the offset, one column per condition."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    run = parser.parse_args().run
    held_out = sorted(read_recordings(run / "data/processed/test"), key=lambda each: each.name)
    truth_n = known_truth(str(run / "data/raw/rig_truth"), held_out)
    model = fit_offset_model(read_recordings(run / "data/processed/train"), CYLINDER)
    hybrid = load_estimator(run / "models/hybrid")
    sessions: dict[str, list[Recording]] = {}
    for recording in held_out:
        sessions.setdefault(recording.metadata.session, []).append(recording)
    sums: dict[tuple[str, str], list[float]] = {}
    for recordings in sessions.values():
        whole_n, first_n = (model.identify(part).offset_n for part in (recordings, recordings[:1]))
        for number, recording in enumerate(recordings):
            usable, true_n = recording.usable(), truth_n[recording.name]
            label_n, estimate_n = recording.column("friction_n"), hybrid.estimate(recording)
            rows = {
                "label": label_n,
                "label less the session's offset": label_n - whole_n,
                "hybrid, cold": estimate_n,
                "hybrid less the session's offset": estimate_n - whole_n,
            }
            if number > 0:
                rows["hybrid, warm"] = estimate_n - first_n
            for name, values_n in rows.items():
                found = sums.setdefault((name, recording.metadata.condition), [0.0, 0.0])
                found[0] += float(np.abs(values_n - true_n)[usable].sum())
                found[1] += float(np.abs(true_n)[usable].sum())
    conditions = sorted({condition for _, condition in sums})
    print("mean absolute error [% of mean |true friction| of the condition]")
    print(f"{'':34}" + "".join(f"{'cond. ' + condition:>9}" for condition in conditions) + f"{'mean':>9}")
    for name in dict.fromkeys(name for name, _ in sums):
        percent = [100.0 * sums[name, condition][0] / sums[name, condition][1] for condition in conditions]
        print(f"{name:34}" + "".join(f"{each:9.2f}" for each in (*percent, float(np.mean(percent)))))


if __name__ == "__main__":
    main()
