"""Do a model's bounds hold if it starts while the piston rests? Held-out starts of three rigs with known friction.

    PYTHONPATH=benchmark/src python performance/starts_at_rest.py [--starts 20] [--zeros 0.05] [RIG ...]

A hybrid is trained on sessions of each rig, as the pipeline does. Then it meets cold starts of its other sessions,
while the piston rests: in the middle of a stroke and at an end stop on the default rig and on an upright one under a
weight that the model knows, and, on the servo rig, recordings cut where the piston rests. Prints, per rig and kind of
start, how often 90 % bounds hold true friction in rows without a flag, and in the worst start; the share of rows that
are flagged ``OFFSET_UNKNOWN`` after a stroke each way; and the bounds' mean half width. ``work`` starts while it moves,
for comparison.

The servo rig needs the package in ``benchmark``.
"""

import argparse
import importlib
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from zero_sweep import BAR, PLAN, RIG, Kind, _stated, raw_recordings

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.labelling.known_offset import training_models, without_offsets
from cylinder_friction.labelling.label import label
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.signals.motion import direction_of_motion

Start = Literal["work", "rest", "end_stop"]
Made = list[tuple[Recording, Array]]
"""Recordings, and the true friction of each [N]."""
SESSIONS, TRAINED, DURATION_S = 6, 4, 40.0  # Sessions in each condition, how many of these train, and their duration
WEIGHT_N, GRAVITY_M_S2 = 1500.0, 9.81
UNEVEN = replace(PLAN, asymmetry=0.4)  # The rod's seal of the servo rig resists one direction more
REST_M_S, REST_S = 5e-4, 0.2
"""A recording of the servo rig is cut where the piston has been slower for at least so long."""


@dataclass(frozen=True)
class Rig:
    """A cylinder, its load if it has one, and its sessions by the kind of start and their number in each condition."""

    cylinder: Cylinder
    load: PositionLoad | None
    record: Callable[[Start, int], Made]
    starts: tuple[Start, ...]
    plan: OffsetPlan = PLAN


def bench(weight_n: float, zero_bar: float) -> Rig:
    """Return the default rig; with a weight it stands upright."""
    cylinder = replace(RIG, moving_mass_kg=RIG.moving_mass_kg + weight_n / GRAVITY_M_S2)
    load = PositionLoad(0.0, RIG.stroke_m, np.full(2, weight_n), np.zeros(2)) if weight_n else None

    def record(start: Start, sessions: int) -> Made:
        own: dict[str, Any] = {"weight_n": weight_n, "residual_offset_bar": zero_bar, "start": start}
        plan = CampaignPlan(0, sessions, 1, DURATION_S, **own)
        logs, truths = raw_recordings(cylinder, plan, Kind(zero_bar, zero_bar))
        return [(log, truth["friction_n"].to_numpy()) for log, truth in zip(logs, truths, strict=True)]

    return Rig(cylinder, load, record, ("work", "rest", "end_stop"))


def servo(zero_bar: float) -> Rig:
    """Return the servo rig; its starts at rest are cut out of recordings."""
    made_by = importlib.import_module("friction_benchmark.servo_rig.sessions")
    made_by.GREATEST_OFFSET_PA = zero_bar * BAR  # type: ignore[attr-defined]

    def record(start: Start, sessions: int) -> Made:
        made = made_by.record_sessions(made_by.SessionPlan(sessions=sessions, duration_s=DURATION_S))
        found = [(_stated(each.recording, Kind(zero_bar, zero_bar)), each.true_friction_n) for each in made]
        return [_cut(*each) for each in found] if start == "rest" else found

    return Rig(made_by.CYLINDER, None, record, ("work", "rest"), UNEVEN)


def _cut(recording: Recording, truth_n: Array) -> tuple[Recording, Array]:
    """Cut a recording at its first rest after a second, if it has one in its first half."""
    speed = np.abs(np.gradient(_smooth(recording.column("position_m")), recording.sample_time_s))
    length = round(REST_S / recording.sample_time_s)
    still = np.convolve(speed < REST_M_S, np.ones(length), "valid") >= length
    rows = np.flatnonzero(still[: len(recording) // 2])
    rows = rows[rows > round(1.0 / recording.sample_time_s)]
    first = int(rows[0]) if len(rows) else 0
    return recording.rows(slice(first, len(recording))), truth_n[first:]


def _smooth(position_m: Array) -> Array:
    return np.convolve(np.pad(position_m, 10, mode="edge"), np.full(21, 1.0 / 21.0), "valid")


def trained(rig: Rig, epochs: int) -> HybridEstimator:
    """Train a hybrid on sessions of the rig; others of them calibrate it."""
    labelled = label([log for log, _ in rig.record("work", SESSIONS)], rig.cylinder, load=rig.load or "none")
    turns: dict[str, list[Recording]] = {}
    for each in labelled:
        turns.setdefault(each.metadata.condition, []).append(each)
    parts = [[each for own in turns.values() for each in own[some]] for some in (slice(TRAINED), slice(TRAINED, None))]
    models, why_not = training_models(parts[0], rig.cylinder, rig.plan)
    if why_not:
        raise SystemExit(f"the offsets of the training sessions are not known: {why_not}")
    train, calibration = (without_offsets(part, models) for part in parts)
    layers, plan = Architecture(1, 16, 0.0, 5e-3), TrainingPlan(epochs, None, 400, 50, 16)
    hybrid = HybridEstimator(rig.cylinder, architecture=layers, plan=plan, position_load=rig.load)
    hybrid.fit(train, (), calibration)
    if hybrid.offset is None:
        raise SystemExit("the model learns no offset, so that its starts show nothing")
    return hybrid


def after_two_strokes(recording: Recording) -> int:
    """Return the first row after a stroke each way."""
    velocity = np.gradient(_smooth(recording.column("position_m")), recording.sample_time_s)
    way = direction_of_motion(velocity, PLAN.slowest_m_s)
    rows = np.flatnonzero(way)
    turns = rows[1:][way[rows[1:]] != way[rows[:-1]]]
    return int(turns[1]) if len(turns) > 1 else len(way)


def report(rig: Rig, start: Start, hybrid: HybridEstimator, count: int) -> str:
    """Return one line of the table."""
    held, unknown, widths = list[float](), list[float](), list[float]()
    conditions = len({log.metadata.condition for log, _ in rig.record(start, 1)})
    made = rig.record(start, SESSIONS + math.ceil(count / conditions))
    later = [own for place, own in enumerate(made) if place % (len(made) // conditions) >= SESSIONS]
    for log, truth_n in later[:count]:
        newtons, flags = RealTimeStream(hybrid.step_model()).run(log.readings(hybrid.inputs))
        rows = flags == 0
        if rows.any():
            held.append(float(((newtons[:, 1] <= truth_n) & (truth_n <= newtons[:, 2]))[rows].mean()))
            widths.append(0.5 * float((newtons[:, 2] - newtons[:, 1])[rows].mean()))
        begun = flags[after_two_strokes(log) :]
        unknown.append(float((begun & Flag.OFFSET_UNKNOWN != 0).mean()) if len(begun) else np.nan)
    return (
        f"{start:10}{len(held):7d}{100.0 * np.mean(held):10.1f} %{100.0 * min(held):8.1f} %"
        f"{100.0 * np.nanmean(unknown):10.1f} %{np.mean(widths):10.1f} N"
    )


def main() -> None:
    """Print one table per rig."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rigs", nargs="*", help="default, upright, servo; without: all")
    parser.add_argument("--starts", type=int, default=20, help="of each kind")
    parser.add_argument("--zeros", type=float, default=0.05, help="largest zero error, stated so [bar]")
    parser.add_argument("--epochs", type=int, default=8, help="of the hybrid's training")
    options = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    made: dict[str, Callable[[], Rig]] = {
        "default": lambda: bench(0.0, options.zeros),
        "upright": lambda: bench(WEIGHT_N, options.zeros),
        "servo": lambda: servo(options.zeros),
    }
    for name in options.rigs or made:
        rig = made[name]()
        hybrid = trained(rig, options.epochs)
        print(f"{name}\nstart      starts        held   worst   unknown later   half width", flush=True)
        for start in rig.starts:
            print(report(rig, start, hybrid, options.starts), flush=True)


if __name__ == "__main__":
    main()
