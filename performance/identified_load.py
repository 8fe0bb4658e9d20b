"""How near the load identified from position is to the true one, on the rig with a crane; and a real crane, day by day.

    make params ARGS="record=boom ingest=rig_boom" && dvc repro offset
    python performance/identified_load.py [--run FOLDER]

First with each session's own load, as ``label`` takes it off; then with that of all training sessions and each
session's sensor offset, as ``offset`` does. Prints, for each condition and for all: what the crane's load reaches;
identified less true load, its mean and its standard deviation within a recording; the label's mean absolute error, the
same less the mean error of all rows, and in how many rows the stated uncertainty holds it.

    python performance/identified_load.py --crane data/raw/crane [--day _230425] [--load all]

trains on all days of a real crane (docs/crane.md) but one, for each day in turn, with the load of these days alone, or
of all. Nobody knows true friction there. Of the held-out day's usable rows it prints each estimator's mean absolute
error against the label, over all rows and while the jib slides; against the label of another smoothing; half of the
estimate extending less retracting at equal position beside that of the measured balance; how far the piston-side
pressure is from the one that friction, load, velocity and the other pressure give, for estimators that do not see it;
and how often the bounds hold the label, as they are and as wide as `estimate` makes them. ± is twice the
standard error of means over 2 s.
"""

import argparse
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import cylinder_friction as cf
from cylinder_friction.arrays import Array
from cylinder_friction.commands.log_options import cylinder_of
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.front_end import Design
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.evaluation.truth import read_truth
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.labelling.sliding_blocks import up_and_down
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.columns import (
    ALL_CONDITIONS,
    LOAD_FORCE,
    OTHER_POSITIONS,
    PRESSURES,
    SAMPLE_COLUMNS,
    UNCERTAINTY_COLUMN,
)
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.splits import ROLES
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.signals.rts import RtsSmoother

INPUTS = (*SAMPLE_COLUMNS, OTHER_POSITIONS[0])
SLIDING_M_S, BLOCK_ROWS = LoadPlan().slowest_m_s, 200
Estimators = dict[str, FrictionEstimator]


def main() -> None:
    """Print both tables of one run, or one table per held-out day."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    parser.add_argument("--crane", type=Path, help="folder of the crane's exports")
    parser.add_argument("--day", help="session to hold out; without: each in turn")
    parser.add_argument("--load", choices=("training", "all"), default="training", help="whose strokes show the load")
    options = parser.parse_args()
    if options.crane:
        print_days(options.crane, options.day, options.load)
        return
    run = options.run
    for title, folders in (("each session's own load", ("labelled",)), ("one load, offsets taken off", ROLES)):
        print(f"{title}\ncondition  load up to     off by    varying     label  less mean  within stated")
        print_table(run, folders)


def print_table(run: Path, folders: tuple[str, ...]) -> None:
    """Print one line per condition, of the recordings in these folders."""
    columns: dict[str, list[np.ndarray]] = {}
    for recording in (each for folder in folders for each in read_stored(run / "data/processed" / folder)):
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


def print_days(folder: Path, only: str | None, load_of: str) -> None:
    """Print one table for each held-out day."""
    cylinder = cylinder_of("conf/cylinder/hmf_2020k_jib.yaml")
    recordings = cf.read_recordings(folder, "conf/ingest/crane.yaml", cylinder)
    for day in [only] if only else sorted({each.metadata.session for each in recordings}):
        warnings.simplefilter("ignore", UserWarning)
        train = [each for each in recordings if each.metadata.session != day]
        test = [each for each in recordings if each.metadata.session == day]
        load = cf.position_load(train if load_of == "training" else recordings, cylinder)
        train, own = (cf.label(each, cylinder, load=load) for each in (train, test))
        other = cf.label(test, cylinder, load=load, signal_filter=RtsSmoother())
        share = 100.0 * _all(own, lambda each: each.usable()).mean()
        print(f"\nheld out: {day}; usable, with the load of the {load_of} days: {share:.0f} % of its rows")
        print_day(fitted([each for each in train if each.usable().any()], cylinder, load), own, other, cylinder)


def fitted(train: Sequence[Recording], cylinder: cf.Cylinder, load: PositionLoad) -> Estimators:
    """Return every estimator of the table, fitted; bounds come from days that models of the other days estimate."""

    def hybrid(design: Design, inputs: tuple[str, ...] = INPUTS, epochs: int = 30) -> cf.HybridEstimator:
        paper = Architecture(4, 64, 0.3, 1e-3)
        chosen, length = (paper, 100) if design == "paper" else (Architecture(1, 16, 0.0, 5e-3), 200)
        plan = TrainingPlan(epochs, None, length)
        known = load if set(SAMPLE_COLUMNS) <= set(inputs) else None
        return cf.HybridEstimator(cylinder, design, chosen, plan, inputs=inputs, position_load=known)

    def made() -> Estimators:
        simple = baselines(cylinder, INPUTS, position_load=load)
        return {
            **{name: simple[name] for name in ("force_balance_unfiltered", "force_balance_low_pass", "ridge")},
            "hybrid": hybrid("force_balance"),
            "paper_hybrid": hybrid("paper", epochs=15),
            "lugre": cf.LugreEstimator(cylinder, generations=20),
            "hybrid without P1": hybrid("force_balance", INPUTS[1:]),
        }

    named = {name: each.fit(train) for name, each in made().items()}
    left_out, estimates_n = list[Recording](), {name: list[Array]() for name in named}
    for day in sorted({each.metadata.session for each in train}):
        others = [each for each in train if each.metadata.session != day]
        own = [each for each in train if each.metadata.session == day]
        left_out += own
        for name, separate in made().items():
            if not separate.has_step:  # nothing gives its bounds
                continue
            separate.fit(others)
            estimates_n[name] += [separate.estimate(each) for each in own]
    for name, estimator in named.items():
        if estimates_n[name]:
            estimator.calibrate(train, left_out, cylinder, estimates_n[name])
    return named


def print_day(named: Estimators, own: Sequence[Recording], other: Sequence[Recording], cylinder: cf.Cylinder) -> None:
    """Print one line per estimator."""
    usable, velocity = _all(own, lambda each: each.usable()), _all(own, lambda each: each.column("velocity_m_s"))
    label, second = (_all(each, lambda one: one.column("friction_n")) for each in (own, other))
    both = usable & _all(other, lambda each: each.usable())
    slides = usable & (np.abs(velocity) > SLIDING_M_S)
    place = _all(own, lambda each: each.column("position_m"))
    p1, p2 = _all(own, lambda each: each.samples(PRESSURES)).T
    balance = p1 * cylinder.piston_area_m2 - p2 * cylinder.annulus_area_m2
    inertia = _all(own, lambda each: np.gradient(each.column("velocity_m_s"), each.sample_time_s))
    given = _all(own, lambda each: each.column(LOAD_FORCE)) + cylinder.moving_mass_kg * inertia
    half_n = up_and_down(place, velocity, balance, slides, SLIDING_M_S)[1]
    size_n = np.abs(label[usable]).mean()
    print(f"mean |label| {size_n:.0f} N, {usable.sum()} rows, {slides.sum()} sliding; half difference {half_n:.0f} N")
    estimates = {name: _all(own, each.estimate) for name, each in named.items()}
    best = min(estimates, key=lambda name: np.abs(estimates[name] - label)[usable].mean())
    print("estimator                 label [%]  sliding [%]  other [%]  half diff. [N]  P1 [bar]  behind the first [%]")
    for name, estimate in estimates.items():
        error = np.abs(estimate - label)
        shares = [100.0 * error[usable].mean() / size_n, 100.0 * error[slides].mean() / np.abs(label[slides]).mean()]
        shares.append(100.0 * np.abs(estimate - second)[both].mean() / size_n)
        turned_n = up_and_down(place, velocity, estimate, slides, SLIDING_M_S)[1] - half_n
        predicts = PRESSURES[0] not in named[name].inputs or name == "lugre"
        bar = np.abs(estimate + given - balance)[slides].mean() / cylinder.piston_area_m2 / 1e5
        behind = (error - np.abs(estimates[best] - label))[usable]
        blocks = 100.0 / size_n * np.array([each.mean() for each in np.array_split(behind, len(behind) // BLOCK_ROWS)])
        print(
            f"{name:26}{shares[0]:9.2f} {shares[1]:12.2f} {shares[2]:11.2f} {turned_n:+14.0f} "
            f"{bar if predicts else np.nan:11.2f} {blocks.mean():12.2f} ± {2.0 * blocks.std() / len(blocks) ** 0.5:.2f}"
        )
    print("90 % bounds hold the label [%]   as calibrated  sliding   as wide as noise asks for  sliding")
    for name, calibrated in named.items():
        if calibrated.bounds is None:
            continue
        print(f"{name:26}", end="")
        for wide in (False, True):
            models = [calibrated.with_bounds_for([each]) if wide else calibrated for each in own]
            steps = [
                model.real_time().run(each.samples(model.inputs))[0] for model, each in zip(models, own, strict=True)
            ]
            lower, upper = np.concatenate(steps)[:, 1:].T
            held = (lower <= label) & (label <= upper)
            print(f"{100.0 * held[usable].mean():{26 if wide else 20}.1f} {100.0 * held[slides].mean():8.1f}", end="")
        print()


def _all(recordings: Sequence[Recording], of: Callable[[Recording], Any]) -> Any:
    return np.concatenate([of(each) for each in recordings])


if __name__ == "__main__":
    main()
