"""How near label and hybrid are to the true friction of the simulated rig, cold and warm, and what the bounds hold.

    python performance/true_friction.py [--run FOLDER] [--lags [--epochs 20]]

Reads a finished run, the present folder by default. ``cold``: each held-out recording begins with what is stated for
the sensors; ``warm``: each later recording of a session with the offset learned in the one before. ``less mean
offset``: the mean of label less truth over all sessions of the cylinder, which no data can determine, is taken off
before scoring.

With ``--lags`` it prints what it is worth to wait: the hybrid, trained anew with the run's hyperparameters, for a fixed
lag of 0, 25 and 50 ms, all with the same number of epochs.
"""

import argparse
from pathlib import Path

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.evaluation.coverage import NEAR
from cylinder_friction.evaluation.truth import known_truth
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.splits import ROLES
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.signals.motion import near_events

EVENT_WINDOW_S = 0.1
CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
LAGS_S = (0.0, 0.025, 0.05)


def main() -> None:
    """Print the figures of one run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    parser.add_argument("--lags", action="store_true", help="train with fixed lags instead")
    parser.add_argument("--epochs", type=int, default=20, help="of each of these trainings")
    arguments = parser.parse_args()
    if arguments.lags:
        print_lags(arguments.run, arguments.epochs)
    else:
        print(report(arguments.run))


def print_lags(run: Path, epochs: int) -> None:
    """Print one row per lag, one column per condition."""
    data, chosen = run / "data", read_json(run / "models/hybrid/chosen.json")
    parts = {role: read_stored(data / "processed" / role) for role in ROLES}
    truth_n = known_truth(str(data / "raw/rig_truth"), parts["test"])
    tracker = OffsetTracker.from_dict(read_json(data / "processed/estimators.json")["offset_tracker"])
    print("mean absolute error [% of mean |true friction| of the condition], and near events [N]")
    print(f"{header(sorted({each.metadata.condition for each in parts['test']}))}{'events':>9}")
    for lag_s in LAGS_S:
        hybrid = HybridEstimator(
            CYLINDER,
            "force_balance",
            Architecture(chosen["layers"], chosen["nodes"], chosen["dropout"], chosen["learning_rate"]),
            TrainingPlan(epochs, patience=12, schedule="cosine"),
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
            events.append(error_n[near_event_rows(recording)])
        print(f"{line(f'lag of {1e3 * lag_s:g} ms', rows)}{np.concatenate(events).mean():9.1f}", flush=True)


def report(run: Path) -> str:
    """Return the figures of a finished run as text."""
    recordings = {role: read_stored(run / "data/processed" / role) for role in ROLES}
    every = [recording for own in recordings.values() for recording in own]
    truth_n = known_truth(str(run / "data/raw/rig_truth"), every)
    mean_n = mean_offset_n(every, truth_n)
    hybrid = load_estimator(run / "models/hybrid")
    rows: dict[str, dict[str, list[tuple[Array, Array]]]] = {}
    events: list[Array] = []
    learned: dict[str, tuple[float, float]] = {}
    for recording in sorted(recordings["test"], key=lambda each: each.name):
        session, usable, true_n = recording.metadata.session, recording.usable(), truth_n[recording.name]
        stream = hybrid.real_time()
        stepped, _ = stream.run(recording.samples(hybrid.inputs))
        estimates = {"label": recording.column("friction_n"), "hybrid, cold": hybrid.aligned(stepped)[:, 0]}
        if session in learned:
            estimates["hybrid, warm"] = hybrid.estimate(recording, *learned[session])
        learned[session] = stream.offset
        for name, values_n in estimates.items():
            for words, taken_n in ((name, 0.0), (f"{name}, less mean offset", mean_n)):
                error_n = np.abs(values_n - taken_n - true_n)[usable]
                by_condition = rows.setdefault(words, {})
                by_condition.setdefault(recording.metadata.condition, []).append((error_n, np.abs(true_n)[usable]))
        events.append(np.abs(estimates["hybrid, cold"] - true_n)[near_event_rows(recording)])
    lines = ["mean absolute error [% of mean |true friction| of the condition]", header(sorted(rows["label"]))]
    lines += [line(words, rows[words]) for words in sorted(rows)]
    lines.append(f"near events, hybrid cold: {np.concatenate(events).mean():.1f} N; mean offset left: {mean_n:.2f} N")
    return "\n".join([*lines, bounds_line(run)])


def near_event_rows(recording: Recording) -> Mask:
    """Return the usable rows near starts, stops and reversals, shape ``(n,)``."""
    window = round(EVENT_WINDOW_S / recording.sample_time_s)
    return near_events(recording.column("velocity_m_s"), window) & recording.usable()


def bounds_line(run: Path) -> str:
    """Return what the bounds of a finished run hold of true friction and how wide they are, as text."""
    truth = [each for each in read_json(run / "reports/coverage.json") if each["reference"] == "truth"]
    (every,) = (each for each in truth if (each["by"], each["group"]) == ("condition", ALL_CONDITIONS))
    near = next((each["held_percent"] for each in truth if each["group"] == NEAR), float("nan"))
    worst = min(each["held_percent"] for each in truth if each["by"] == "session")
    return (
        f"bounds hold {every['held_percent']:.1f} % of true friction, near events {near:.1f} %, "
        f"worst session {worst:.1f} %, mean width {every['mean_width_n']:.1f} N"
    )


def mean_offset_n(recordings: list[Recording], truth_n: dict[str, Array]) -> float:
    """Return the mean over sessions of label less truth [N]."""
    sessions: dict[str, list[Array]] = {}
    for recording in recordings:
        error_n = (recording.column("friction_n") - truth_n[recording.name])[recording.usable()]
        sessions.setdefault(recording.metadata.session, []).append(error_n)
    return float(np.mean([np.concatenate(parts).mean() for parts in sessions.values()]))


def header(conditions: list[str]) -> str:
    """Return the head of a table of ``line``."""
    return f"{'':32}" + "".join(f"{'cond. ' + condition:>9}" for condition in conditions) + f"{'mean':>9}"


def line(words: str, by_condition: dict[str, list[tuple[Array, Array]]]) -> str:
    """Return the percent of each condition and their mean, from absolute errors and friction of its recordings [N]."""
    percent = []
    for condition in sorted(by_condition):
        error_n, friction_n = (np.concatenate(each) for each in zip(*by_condition[condition], strict=True))
        percent.append(100.0 * float(error_n.sum() / friction_n.sum()))
    return f"{words:32}" + "".join(f"{each:9.2f}" for each in (*percent, float(np.mean(percent))))


if __name__ == "__main__":
    main()
