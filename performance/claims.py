"""Is what the commands say of losses, loads, zeros and bounds true? Each sentence is counted against the simulation.

    python performance/claims.py [--quick] [--seeds N] [--first-seed N]

Campaigns of the simulated rig, with options that are off by default: sensors at a valve behind a line that loses
pressure (one per condition and all together), that loss stated rightly and 20 % wrong, and one motion at 100, 200, 500
and 1000 Hz. Prints a row per sentence or figure: the place in the code that makes it, how many were counted, and how
many were true. ``intervals`` prints, by kind of campaign, how often stated intervals of label, offset, Stribeck point,
load and parameters hold truth; what has no number is not counted. ``masses`` prints the same of the moving mass that a
session's motion determines, on rigs with payloads, whose seals remember rest and whose position comes in steps of 0.1
mm, and how often the mass is unknown. ``--quick`` takes one seed and shorter recordings.

The servo rig of ``masses`` needs the package in ``benchmark``.
"""

import argparse
import importlib
import math
import re
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sentences import (
    LOAD,
    NAMES,
    ONLY_INTERVALS,
    WORLDS,
    Simulated,
    holds,
    sentences,
    simulated,
    write_logs,
)
from zero_sweep import RIG, Kind, evidence_of, raw_recordings

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.friction_of_logs import LabelledLogs
from cylinder_friction.estimation.identification import MOST_ROWS, ModelSearch
from cylinder_friction.estimation.results import load_left
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.labelling.apparent_loss import named_loss
from cylinder_friction.labelling.known_offset import HIGHEST_SPEED, STROKES
from cylinder_friction.labelling.label import Labeller, by_session, label
from cylinder_friction.recordings.columns import PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.conversion import logged_files
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.logs import find_logs
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.rig.campaign import LOSS_SPEED_M_S
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.signals.smooth_signals import filtered
from cylinder_friction.signals.zero_phase import default_filter

KIND = Kind(0.15, 0.15)
LOSSES_BAR = (0.0, 1.0, 2.0, 3.0, 6.0)
"""Lost at 0.1 m/s; the rig moves at up to 0.07 m/s. With more, transmitters at the valve end at their lowest value."""
LAMINAR = 0.2
OF_THE_RIG = 9
"""Sessions of a condition, of which three are logged, that show friction of the rig."""
AT_REST_M_S = 1e-3
MEMORY: dict[str, Any] = {"ageing": 0.07, "position_step_m": 1e-4}
"""Seals that stick harder the longer they rest, and a coarse position."""
PAYLOADS: dict[str, tuple[float, dict[str, Any]]] = {
    "sled of 260 kg": (260.0, {}),
    "sled of 900 kg": (900.0, {}),
    "sled of 260 kg, memory, 0.1 mm": (260.0, MEMORY),
    "sled of 900 kg, memory, 0.1 mm": (900.0, MEMORY),
    "weight of 430 kg, memory, 0.1 mm": (430.0, {**MEMORY, "weight_n": 4218.0}),
}
"""Moving mass [kg] and further fields of ``CampaignPlan``."""
SERVO_KG, SERVO_RENEWAL_M = 260.0, 2e-3
"""Payload of the servo rig, and the travel that renews its contacts."""
STATED = (1.0, 1.2, 1.3, 1.4, 0.8, 0.7, 0.6)
"""Losses as stated, over the true ones."""
SPEEDS_M_S = (0.0, 0.02, 0.04, 0.06, np.inf)
"""Limits of classes of speed; the rig moves at up to 0.07 m/s."""
Row = tuple[str, str, bool | float]
"""Place in the code, sentence or figure, and whether it was true, or its value."""


def campaign_of(seed: int, quick: bool, **options: float) -> tuple[list[Recording], list[pd.DataFrame]]:
    """Return raw recordings of a campaign and their truth."""
    plan = CampaignPlan(
        seed=seed,
        sessions_per_condition=2 if quick else 4,
        recordings_per_session=1,
        duration_s=20.0 if quick else 30.0,
        residual_offset_bar=KIND.zero_bar,
        specimen="wide",
        **options,  # type: ignore[arg-type]
    )
    return raw_recordings(RIG, plan, KIND)


def loss_n(bar: float, speed_m_s: float) -> float:
    """Return the simulated loss as friction at a speed [N], compressibility left out."""
    total_n = 0.0
    for area, part in ((RIG.piston_area_m2, 1.0), (RIG.annulus_area_m2, None)):
        share = (part or RIG.annulus_area_m2 / RIG.piston_area_m2) * speed_m_s / LOSS_SPEED_M_S
        total_n += area * 1e5 * bar * share * (LAMINAR + (1.0 - LAMINAR) * share)
    return total_n


def losses(seed: int, quick: bool) -> Iterator[Row]:
    """Yield whether losses are named if there is one, and only then, and what bounds hold."""
    place = "labelling/apparent_loss.py sentence"
    for bar in LOSSES_BAR[:4] if quick else LOSSES_BAR:
        logs, truths = campaign_of(seed, quick, line_loss_bar=bar)
        labelled = label(logs, RIG)
        evidence = [evidence_of(each, RIG) for each in labelled]
        conditions = sorted({each.condition for each in evidence})
        for own in (evidence, *([each for each in evidence if each.condition == name] for name in conditions)):
            found = named_loss(own)
            speeds = [np.abs(each.sliding.columns["velocity_m_s"]) for each in own]
            highest = float(np.quantile(np.concatenate(speeds), HIGHEST_SPEED))
            sessions = {each.session for each in own}
            pairs = [pair for pair in zip(labelled, truths, strict=True) if pair[0].metadata.session in sessions]
            friction_n = float(np.mean([truth["friction_n"].abs().mean() for _, truth in pairs]))
            if bar == 0.0:
                yield place, "without a line, no loss is named", found is None
            elif loss_n(bar, highest) > friction_n:
                yield place, "a loss larger than friction is named", found is not None
            if found is not None and bar:
                for each, truth in pairs:
                    also_n = found.most_n(each.column("velocity_m_s"))
                    yield "estimation: bounds", "held %, unstated loss named", held(each, truth, also_n)
        if bar:
            yield from stated_losses(logs, truths, bar)


def held(labelled: Recording, truth: pd.DataFrame, also_n: Array | float = 0.0, rows: Mask | bool = True) -> float:
    """Return how often bounds hold true friction in rows [%]."""
    rows, half_n = labelled.usable() & rows, labelled.column(UNCERTAINTY_COLUMN) + also_n
    off_n = np.abs(labelled.column("friction_n") - truth["friction_n"].to_numpy())
    return 100.0 * float(np.mean((off_n <= half_n)[rows]))


def free_error(labelled: Recording, truth: pd.DataFrame) -> float:
    """Return the label's error free of its mean [N]."""
    rows = labelled.usable()
    off_n = (labelled.column("friction_n") - truth["friction_n"].to_numpy())[rows]
    return float(np.mean(np.abs(off_n - off_n.mean())))


def stated_losses(logs: Sequence[Recording], truths: Sequence[pd.DataFrame], bar: float) -> Iterator[Row]:
    """Yield what becomes of a loss that is stated with the default uncertainty: rightly, and 20 to 40 % wrong."""
    areas = (RIG.piston_area_m2, RIG.annulus_area_m2)
    own_speeds = (LOSS_SPEED_M_S, LOSS_SPEED_M_S * areas[0] / areas[1])
    for each, truth in zip(logs, truths, strict=True):
        speed_m_s = truth["velocity_m_s"].abs().to_numpy()
        for factor in STATED:
            lines = {
                name: LineLoss(factor * bar, speed, laminar_percent=100.0 * LAMINAR)
                for name, speed in zip(PRESSURES, own_speeds, strict=True)
            }
            (found,) = label([replace(each, metadata=replace(each.metadata, line_loss=lines))], RIG)
            if factor == 1.0:
                known = without_loss(each, truth, bar)
                ratio = free_error(found, truth) / free_error(label([known], RIG)[0], truth)
                yield "signals/smooth_signals.py at_cylinder", "error, loss stated, over sensors at the ports", ratio
            for lowest, highest in pairwise(SPEEDS_M_S):
                rows = (speed_m_s >= lowest) & (speed_m_s < highest)
                if (rows & found.usable()).any():
                    figure = f"held %, {factor:g} of the loss stated, {lowest:g} to {highest:g} m/s"
                    yield "labelling/uncertainty.py", figure, held(found, truth, rows=rows)


def without_loss(recording: Recording, truth: pd.DataFrame, bar: float) -> Recording:
    """Return the recording as sensors at the ports would read it, from the true velocity."""
    ratio = RIG.annulus_area_m2 / RIG.piston_area_m2
    columns = {}
    for name, share in zip(PRESSURES, (1.0, -ratio), strict=True):
        part = share * truth["velocity_m_s"].to_numpy() / LOSS_SPEED_M_S
        columns[name] = recording.column(name) - 1e5 * bar * part * (LAMINAR + (1.0 - LAMINAR) * np.abs(part))
    return recording.with_columns(**columns)


def rates(seed: int, quick: bool) -> Iterator[Row]:
    """Yield errors at each rate over those at 200 Hz, of one motion: of the label, and of a hybrid in new sessions.

    At 100 Hz also over a causal balance, a low-pass tuned on the hybrid's own training.
    """
    found: dict[float, tuple[float, ...]] = {}
    for step_s in (0.01, 0.005, 0.002, 0.001):
        logs, truths = campaign_of(seed, quick, sample_time_s=step_s)
        labelled = label(logs, RIG)
        names = sorted({each.metadata.session for each in labelled})
        new = {name for number, name in enumerate(names) if number % 4 == 3 or (quick and number % 2)}
        train = [each for each in labelled if each.metadata.session not in new]
        plan = replace(HybridEstimator(RIG).plan, epochs=10, patience=None)
        estimators = (
            HybridEstimator(RIG, plan=plan).fit(train, ()),
            LowPassForceBalanceEstimator(RIG).fit(train),
        )
        errors = [free_error(*pair) for pair in zip(labelled, truths, strict=True)]
        held = [pair for pair in zip(labelled, truths, strict=True) if pair[0].metadata.session in new]
        of_each = [
            float(
                np.mean([free_error(each.with_columns(friction_n=model.estimate(each)), truth) for each, truth in held])
            )
            for model in estimators
        ]
        found[step_s] = (float(np.mean(errors)), *of_each)
    for step_s, (own, hybrid, balance) in found.items():
        rate = f"error at {1.0 / step_s:.0f} Hz over"
        yield "signals/zero_phase.py", f"{rate} that at 200 Hz, label", own / found[0.005][0]
        yield "estimators/hybrid.py", f"{rate} that at 200 Hz, hybrid", hybrid / found[0.005][1]
        yield "estimators/hybrid.py", f"{rate} that of a tuned low-pass, hybrid", hybrid / balance


def intervals(seed: int, quick: bool) -> Iterator[Row]:
    """Yield how often stated 95 % intervals hold truth, by kind of campaign, each from logs."""
    for name, world in (WORLDS | ONLY_INTERVALS).items():
        made = simulated(world, seed, quick)
        with tempfile.TemporaryDirectory() as scratch:
            mapping, all_logs = write_logs(made, Path(scratch)), f"{scratch}/logs/*.csv"
            logs = find_logs(all_logs, mapping, made.cylinder, names=NAMES, load=world.load)
            run = LabelledLogs(logs, logged_files(logs), Path(scratch) / "kept", None)
            labelled = list(run.recordings(MOST_ROWS))
        for quantity, held_ in intervals_of(made, simulated(world, seed, quick, OF_THE_RIG), run, labelled):
            yield f"95 % interval of {quantity}", name, held_


def intervals_of(
    made: Simulated, longer: Simulated, run: LabelledLogs, labelled: Sequence[tuple[Recording, str]]
) -> Iterator[tuple[str, bool | float]]:
    """Yield each quantity that has an interval, and whether that holds truth; of a label, the percentage of rows.

    A Stribeck point is to hold friction of its condition, other strokes and sessions included: of a longer campaign.
    """
    for found in filter(None, (re.search(LOAD, words) for _, words in labelled)):
        yield (
            "load",
            abs(0.5 * (float(found[1]) + float(found[2] or found[1])) - made.world.weight_n) <= float(found[3]),
        )
    for session, offset in run.offsets.items():
        if math.isfinite(offset.uncertainty_n):
            off_n = made.zero_n(session) - (offset.offset_n if offset.source == STROKES else 0.0)
            yield f"offset, {offset.source}", abs(off_n) <= offset.uncertainty_n
    refused = {each.name for each, load in labelled if load_left(run.friction.entry(each, load))}
    used = list[Recording]()
    for each in (each for each, _ in labelled if each.name not in refused):
        truth_n = made.own(each.name)[0].truth["friction_n"].to_numpy()[: len(each)]
        within = (each.column("lower_n") <= truth_n) & (truth_n <= each.column("upper_n"))
        yield "label", 100.0 * float(within[each.usable()].mean())
        half_n = 0.5 * (each.column("upper_n") - each.column("lower_n"))[each.usable()]
        yield (
            "label, half width over friction in %",
            100.0 * float(half_n.mean() / np.abs(truth_n[each.usable()]).mean()),
        )
        used.append(each)
    if not used:
        return
    search = ModelSearch(used, run, generations=2, seed=0)
    for curve in search.curves:
        for point in curve.points:
            true_n = longer.friction_at(f"condition{curve.condition}", point.velocity_m_s)
            if point.known_half_width_n is not None and math.isfinite(true_n):
                yield "Stribeck point", bool(abs(point.friction_n - true_n) <= point.half_width_n)
    plain = search.plain()
    for parameter in plain.parameters:
        condition, interval = plain.recordings[0].split("_")[0], parameter.interval
        true_range = made.parameter(parameter.name, condition)
        if parameter.name == "static_n":
            true_range = breakaway_n(made, condition)
        if interval is None or true_range is None:
            continue
        if parameter.name == "viscous_n_s_m":  # Each session has oil of its own temperature
            yield "viscous_n_s_m, of all sessions", interval[0] <= true_range[0] and true_range[1] <= interval[1]
        yield parameter.name, holds(interval, true_range)


def breakaway_n(made: Simulated, condition: str) -> tuple[float, float] | None:
    """Return least and greatest breakaway of a condition's sessions [N], as friction is highest when extension starts.

    It is the 90 % quantile of a session's starts: many begin before the film of oil between seal and bore is gone.
    """
    values = list[float]()
    for each in made.own(condition):
        speed_m_s, friction_n = each.truth["velocity_m_s"].to_numpy(), each.truth["friction_n"].to_numpy()
        before, after = (round(time_s / each.metadata.sample_time_s) for time_s in (0.2, 0.1))
        starts = np.flatnonzero((np.abs(speed_m_s[:-1]) < AT_REST_M_S) & (speed_m_s[1:] >= AT_REST_M_S))
        peaks_n = [friction_n[max(start - before, 0) : start + after].max() for start in starts]
        values += [float(np.quantile(peaks_n, 0.9))] if peaks_n else []
    return (min(values), max(values)) if values else None


def masses(seed: int, quick: bool) -> Iterator[Row]:
    """Yield whether the interval of each session's moving mass holds the true one, and whether it is unknown."""
    for name, (mass_kg, options) in PAYLOADS.items():
        plan = CampaignPlan(
            seed=seed,
            sessions_per_condition=1 if quick else 2,
            recordings_per_session=2,
            duration_s=60.0,
            residual_offset_bar=KIND.zero_bar,
            specimen="wide",
            **options,
        )
        cylinder = replace(RIG, moving_mass_kg=mass_kg)
        logs, _ = raw_recordings(cylinder, plan, KIND)
        yield from masses_of(name, logs, cylinder)
    servo = importlib.import_module("friction_benchmark.servo_rig.sessions")
    drive, seals = servo.Drive, servo.Seals
    servo.Drive = partial(drive, mass_kg=SERVO_KG)  # type: ignore[attr-defined]
    servo.Seals = partial(seals, renewal_m=SERVO_RENEWAL_M)  # type: ignore[attr-defined]
    made = servo.record_sessions(servo.SessionPlan(seed=seed, sessions=1 if quick else 2))
    servo.Drive, servo.Seals = drive, seals  # type: ignore[attr-defined]
    cylinder = replace(servo.CYLINDER, moving_mass_kg=SERVO_KG)
    yield from masses_of(f"servo rig, {SERVO_KG:.0f} kg, memory", [each.recording for each in made], cylinder)


def masses_of(name: str, logs: Sequence[Recording], cylinder: Cylinder) -> Iterator[Row]:
    """Yield what is identified of the mass in each session of a campaign."""
    chosen, labeller = default_filter(cylinder), Labeller(cylinder, inertia="identified")
    for own in by_session([filtered(each, chosen) for each in logs]).values():
        motion = labeller.identify(own, chosen).motion
        assert motion is not None
        for kind in (name, "all"):
            yield "moving mass unknown [%]", kind, not motion.mass_known
            if motion.mass_known:
                low, high = motion.mass_interval_kg
                yield "95 % interval of moving mass", kind, low <= cylinder.moving_mass_kg <= high
                yield "its half width over the mass [%]", kind, 50.0 * (high - low) / motion.mass_kg


PARTS = {
    "intervals": intervals,
    "losses": losses,
    "masses": masses,
    "rates": rates,
    "sentences": sentences,
}


def main() -> None:
    """Print one row per sentence or figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", metavar="PART", nargs="*", default=list(PARTS), help=f"of: {', '.join(PARTS)}")
    parser.add_argument("--quick", action="store_true", help="one seed, shorter recordings")
    parser.add_argument("--seeds", type=int, default=4, help="campaigns of each kind")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first campaign of each kind")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    seeds = range(arguments.first_seed, arguments.first_seed + (1 if arguments.quick else arguments.seeds))
    found = [row for name in arguments.parts for seed in seeds for row in PARTS[name](seed, arguments.quick)]
    table = pd.DataFrame(found, columns=["place", "sentence or figure", "value"])
    table["value"] = [100.0 * each if isinstance(each, bool | np.bool_) else float(each) for each in table["value"]]
    groups = table.groupby(["place", "sentence or figure"], sort=False)["value"]
    worst = groups.quantile(0.9).round(2)
    shown = pd.DataFrame({"counted": groups.size(), "mean": groups.mean().round(2), "worst decile": worst})
    print(shown.to_string())


if __name__ == "__main__":
    main()
