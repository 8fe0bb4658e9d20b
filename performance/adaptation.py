"""How little data a new cylinder needs: error against minutes of recordings, adapted and from scratch.

    python performance/adaptation.py [--model models/hybrid] [--minutes 1 2 ...] [--duty 1 2 3] [--crane FOLDER]

The model is adapted to the servo rig of ``benchmark``, whose package this needs, and with ``--crane`` to the jib of the
loader crane whose scope exports FOLDER holds. A minute of the servo rig is a session with seals, oil and sensor zeros
of its own, by turns of the three duty cycles; of the crane a recording is a session, and its load is that identified in
the recording itself, given as if a load cell had measured it. All estimators get the same recordings, and are tested
on the same other sessions, on the crane of other days.

Prints the mean absolute error against the label in percent of its mean absolute value, on the servo rig also against
true friction, each session's mean error taken off, and what the adapted bounds hold.
"""

import argparse
import importlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.columns import LOAD_FORCE, SAMPLE_COLUMNS
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction.recordings.recording import Recording

Truth = Mapping[str, Array] | None  # True friction by the name of a recording [N]
Makers = dict[str, Callable[[Sequence[Recording]], FrictionEstimator]]

MINUTES = (1, 2, 5, 10, 20, 30)
TEST_SESSIONS, FIRST_TEST = 9, 100
JIB = Cylinder(bore_diameter_m=0.150, rod_diameter_m=0.100, stroke_m=0.85, moving_mass_kg=100.0)
CRANE_CHANNELS = {
    "pressure_1_pa": {"channel": "JibPaCyl", "unit": "bar"},
    "pressure_2_pa": {"channel": "JibPbCyl", "unit": "bar"},
    "position_m": {"channel": "JibPistonPosition", "unit": "m"},
}


def main() -> None:
    """Print one row per amount of data."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/hybrid"), help="to adapt")
    parser.add_argument("--minutes", type=int, nargs="*", default=MINUTES, help="of the servo rig")
    parser.add_argument("--seed", type=int, default=0, help="of the servo rig")
    parser.add_argument("--duty", nargs="*", default=(), help="cycles of the servo rig to learn from, each alone")
    parser.add_argument("--crane", type=Path, help="folder of its exports")
    parser.add_argument("--without-scratch", action="store_true", help="leave out what takes longest")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    source = load_estimator(arguments.model)
    assert isinstance(source, HybridEstimator)
    print(f"{'minutes':24}{'low-pass':>16}{'ridge':>16}{'scratch':>16}{'adapted':>16}{'bounds hold':>16}")
    if arguments.minutes:
        cylinder, train, test, truth_n = servo_rig(max(arguments.minutes), arguments.seed)
        for minutes in arguments.minutes:
            made = makers(source, cylinder, SAMPLE_COLUMNS, arguments.without_scratch)
            print(row(f"servo rig {minutes}", made, train[:minutes], test, truth_n), flush=True)
        for duty in arguments.duty:
            cylinder, train, test, truth_n = servo_rig(minutes, arguments.seed, duty)
            made = makers(source, cylinder, SAMPLE_COLUMNS, arguments.without_scratch)
            print(row(f"servo rig {minutes}, duty {duty}", made, train, test, truth_n), flush=True)
    days = crane(arguments.crane) if arguments.crane else {}
    for day, test in days.items():
        others = [each for name, own in days.items() if name != day for each in own]
        for count in range(1, len(others) + 1):
            minutes = sum(len(each) * each.sample_time_s for each in others[:count]) / 60.0
            made = makers(source, JIB, (*SAMPLE_COLUMNS, LOAD_FORCE), arguments.without_scratch)
            print(row(f"crane, test {day} {minutes:.1f}", made, others[:count], test), flush=True)


def makers(source: HybridEstimator, cylinder: Cylinder, inputs: Sequence[str], without_scratch: bool) -> Makers:
    """Return what makes each estimator of recordings."""
    made: Makers = {
        "low-pass": LowPassForceBalanceEstimator(cylinder, inputs=inputs).fit,
        "ridge": RidgeEstimator(inputs=inputs).fit,
        "scratch": HybridEstimator(cylinder, inputs=inputs).fit,
        "adapted": lambda recordings: source.adapt(recordings, cylinder),
    }
    return {name: each for name, each in made.items() if name != "scratch" or not without_scratch}


def row(title: str, made: Makers, train: Sequence[Recording], test: Sequence[Recording], truth_n: Truth = None) -> str:
    """Return a line: each estimator's errors [%], and what the bounds of the last one hold [%]."""
    cells = []
    for name in ("low-pass", "ridge", "scratch", "adapted"):
        try:
            estimator = made[name](train) if name in made else None
        except ValueError:  # too little for this one
            estimator = None
        cells.append("-" if estimator is None else errors(estimator, test, truth_n))
    held = "-" if estimator is None else f"{bounds_held(estimator, test, truth_n):.1f}"
    return f"{title:24}{''.join(f'{cell:>16}' for cell in (*cells, held))}"


def errors(estimator: FrictionEstimator, test: Sequence[Recording], truth_n: Truth) -> str:
    """Return the error against the label and, where it is known, that against true friction, in percent."""
    sums = np.zeros(4)
    for each in test:
        usable, estimate_n, label_n = each.usable(), estimator.estimate(each), each.column("friction_n")
        true_n = label_n if truth_n is None else truth_n[each.name]
        error_n = (estimate_n - true_n)[usable]
        parts = (estimate_n - label_n)[usable], label_n[usable], error_n - error_n.mean(), true_n[usable]
        sums += [np.abs(part).sum() for part in parts]
    against = [f"{100.0 * sums[place] / sums[place + 1]:.2f}" for place in (0, 2)]
    return " / ".join(against if truth_n is not None else against[:1])


def bounds_held(estimator: FrictionEstimator, test: Sequence[Recording], truth_n: Truth) -> float:
    """Return how often the bounds hold true friction, or the label where it is not known [%]."""
    held = []
    for each in test:
        newtons, _ = estimator.real_time().run(each.samples(estimator.inputs))
        friction_n = each.column("friction_n") if truth_n is None else truth_n[each.name]
        held.append(((newtons[:, 1] <= friction_n) & (friction_n <= newtons[:, 2]))[each.usable()])
    return 100.0 * float(np.concatenate(held).mean())


def servo_rig(
    minutes: int, seed: int, duty: str = ""
) -> tuple[Cylinder, list[Recording], list[Recording], dict[str, Array]]:
    """Return the servo rig's cylinder, labelled sessions to learn from and to test on, and the true friction [N].

    Sessions to learn from are of one duty cycle, or of all three by turns; those to test on are of all.
    """
    servo = importlib.import_module("friction_benchmark.servo_rig.sessions")
    plan = servo.SessionPlan(seed=seed, duration_s=60.0)
    learnt = range(int(duty) - 1, 3 * minutes, 3) if duty else range(minutes)
    numbers = [*learnt, *range(3 * FIRST_TEST, 3 * FIRST_TEST + TEST_SESSIONS)]
    made = [servo.record(plan, str(1 + number % 3), 1 + number // 3) for number in numbers]
    labelled = label([each.recording for each in made], servo.CYLINDER)
    truth_n = {each.recording.name: each.true_friction_n for each in made}
    return servo.CYLINDER, labelled[:minutes], labelled[minutes:], truth_n


def crane(folder: Path) -> dict[str, list[Recording]]:
    """Return the labelled recordings of the jib by day; those in which it stands are left out."""
    read = []
    for name in ("time", "Name"):  # in exports of March, and of April
        channels = {"time_s": {"channel": name, "unit": "ms"}, **CRANE_CHANNELS}
        read += read_recordings(folder, channels, JIB, load="position")
    days: dict[str, list[Recording]] = {}
    for each in label(read, JIB, load="position"):
        days.setdefault(each.name.removesuffix(".csv").rpartition("_")[2], []).append(each)
    return days


if __name__ == "__main__":
    main()
