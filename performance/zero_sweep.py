"""Does identifying the zeros of pressure sensors ever make friction worse? Labels of short campaigns with known truth.

    python performance/zero_sweep.py [--seeds N] [KIND ...]
    python performance/zero_sweep.py --train [--seeds N] [KIND ...]

A kind of campaign is a rig, the zeros' limits as they are and as stated [bar], and how asymmetric friction is. Every
campaign of four or three conditions with six sessions each is labelled; zeros are identified from all sessions, from
one condition, from twelve, from two and from one. Prints, per kind and grouping, the label's mean absolute error
with identified zeros over that without (median, worst decile, largest; share above 1.05), both errors in percent of
mean friction, how often the label's bounds hold true friction, intervals of Stribeck points those of true friction,
and how often an offset lies within what is stated. ``claims.py`` counts sentences on losses, loads and rates.

With ``--train`` a hybrid is trained on four sessions of each condition, as the pipeline does; of those held out it
prints the error and how often its bounds hold true friction, with and without what it learns of their zeros.

The kinds of the servo rig need the package in ``benchmark``.
"""

import argparse
import importlib
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identified_model import stribeck_points
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.labelling.known_offset import (
    STROKES,
    KnownOffset,
    OffsetEvidence,
    known_offsets,
    mean_uncertainty_n,
    offset_evidence,
    training_models,
    without_offsets,
)
from cylinder_friction.labelling.label import label
from cylinder_friction.labelling.sliding_blocks import OffsetPlan, up_and_down
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.recording import Recording, SensorUncertainty
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.rig.sensors import DECIMALS

BAR = 1e5
RIG = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
PLAN = OffsetPlan()


@dataclass(frozen=True)
class Kind:
    """A kind of campaign."""

    zero_bar: float  # Largest zero error of a pressure sensor
    stated_bar: float  # What is stated for it
    specimen: str = "wide"  # Of the default rig; ``servo`` is the other rig
    asymmetry_sd: float = 0.0  # Of friction retracting over extending, from session to session
    zeroed: bool = True  # Whether sensors are stated to be zeroed before each session
    options: tuple[tuple[str, Any], ...] = ()  # Further fields of ``CampaignPlan``


KINDS = {
    "default": Kind(0.05, 0.05, "default"),
    "wide zeros": Kind(0.15, 0.15),
    "stated too large": Kind(0.05, 0.15),
    "stated too small": Kind(0.15, 0.05),
    "asymmetry by session": Kind(0.15, 0.15, asymmetry_sd=0.02),
    "asymmetry by condition": Kind(0.15, 0.15, options=(("asymmetry_by_condition", 0.1),)),
    "zeros kept": Kind(0.15, 0.15, zeroed=False, options=(("zeros", "kept"),)),
    "zeros drift": Kind(0.15, 0.15, zeroed=False, options=(("zeros", "drifting"),)),
    "zeros kept and drift": Kind(0.15, 0.15, zeroed=False, options=(("zeros", "kept and drifting"),)),
    "zeros anew, not stated so": Kind(0.15, 0.15, zeroed=False),
    "pressure lag": Kind(0.15, 0.15, options=(("pressure_lag_s", 0.01),)),
    "100 Hz": Kind(0.15, 0.15, options=(("sample_time_s", 0.01),)),
    "500 Hz": Kind(0.15, 0.15, options=(("sample_time_s", 0.002),)),
    "servo rig": Kind(0.15, 0.15, "servo"),
    "servo rig, large zeros": Kind(0.5, 0.5, "servo"),
}


def recordings(
    kind: Kind, seed: int, sessions: int, duration_s: float
) -> tuple[Cylinder, list[Recording], list[Array]]:
    """Return labelled recordings of a campaign, and the true friction [N] of each."""
    if kind.specimen == "servo":
        return _servo_recordings(kind, seed, sessions, duration_s)
    plan = CampaignPlan(
        seed=seed,
        sessions_per_condition=sessions,
        recordings_per_session=1,
        duration_s=duration_s,
        residual_offset_bar=kind.zero_bar,
        asymmetry_sd=kind.asymmetry_sd,
        specimen=kind.specimen,  # type: ignore[arg-type]
        **dict(kind.options),
    )
    logs, truths = raw_recordings(RIG, plan, kind)
    return RIG, label(logs, RIG), [truth["friction_n"].to_numpy() for truth in truths]


def raw_recordings(cylinder: Cylinder, plan: CampaignPlan, kind: Kind) -> tuple[list[Recording], list[pd.DataFrame]]:
    """Return the recordings of a campaign with their sensors stated, and the truth of each."""
    recorded = list(campaign(cylinder, plan))
    logs = [_stated(Recording(each.metadata, _in_si(each.logger)), kind) for each in recorded]
    return logs, [each.truth for each in recorded]


def _servo_recordings(
    kind: Kind, seed: int, sessions: int, duration_s: float
) -> tuple[Cylinder, list[Recording], list[Array]]:
    servo = importlib.import_module("friction_benchmark.servo_rig.sessions")
    servo.GREATEST_OFFSET_PA = kind.zero_bar * BAR  # type: ignore[attr-defined]
    made = servo.record_sessions(servo.SessionPlan(seed=seed, sessions=sessions, duration_s=duration_s))
    labelled = label([_stated(each.recording, kind) for each in made], servo.CYLINDER)
    return servo.CYLINDER, labelled, [each.true_friction_n for each in made]


def _in_si(logger: pd.DataFrame) -> pd.DataFrame:
    time_s, pressure_1, pressure_2, position, warm = (logger.iloc[:, place].round(DECIMALS) for place in range(5))
    columns = {"time_s": time_s, "pressure_1_pa": BAR * pressure_1, "pressure_2_pa": BAR * pressure_2}
    return pd.DataFrame(columns | {"position_m": 1e-3 * position, "oil_temperature_c": warm})


def _stated(recording: Recording, kind: Kind) -> Recording:
    sensor = SensorUncertainty(kind.stated_bar * BAR / np.sqrt(3.0), 0.0005, 0.061 * BAR, kind.zeroed)
    return replace(recording, metadata=replace(recording.metadata, uncertainty=dict.fromkeys(PRESSURES, sensor)))


def groupings(labelled: list[Recording], seed: int) -> Iterator[tuple[str, list[int]]]:
    """Yield which recordings are given to one call."""
    generator, everything = np.random.default_rng(seed), range(len(labelled))
    yield "all sessions", list(everything)
    for condition in sorted({each.metadata.condition for each in labelled}):
        yield "one condition", [place for place in everything if labelled[place].metadata.condition == condition]
    for count, title in ((12, "twelve sessions"), (12, "twelve sessions"), (2, "two sessions"), (1, "one session")):
        yield title, generator.choice(len(labelled), count, replace=False).tolist()


def identified(labelled: list[Recording], cylinder: Cylinder) -> dict[str, KnownOffset]:
    """Return what a call knows of the offset of each session."""
    evidence = [evidence_of(each, cylinder) for each in labelled]
    return {each.session: each for each in known_offsets(evidence, cylinder, PLAN)}


def evidence_of(labelled: Recording, cylinder: Cylinder) -> OffsetEvidence:
    """Return what a labelled recording shows, as the commands collect it."""
    position_m, velocity_m_s, friction_n = map(labelled.column, ("position_m", "velocity_m_s", "friction_n"))
    halves = up_and_down(position_m, velocity_m_s, friction_n, labelled.usable(), PLAN.slowest_m_s)
    return offset_evidence(labelled, cylinder, PLAN, *halves, "")


def one_call(labelled: list[Recording], truths_n: list[Array], cylinder: Cylinder) -> Iterator[dict[str, float]]:
    """Yield what became of each recording of one call."""
    known = identified(labelled, cylinder)
    held = points_held(labelled, truths_n, known)
    for each, truth_n in zip(labelled, truths_n, strict=True):
        found, rows = known[each.metadata.session], each.usable()
        error_n, half_n = (each.column("friction_n") - truth_n)[rows], each.column(UNCERTAINTY_COLUMN)[rows]
        level_n, left_n = float(np.mean(np.abs(truth_n[rows]))), error_n - found.correction_n
        missed_n = abs(float(np.mean(error_n)) - found.offset_n)
        yield {
            "with %": 100.0 * float(np.mean(np.abs(left_n))) / level_n,
            "without %": 100.0 * float(np.mean(np.abs(error_n))) / level_n,
            "label held %": 100.0 * float(np.mean(np.abs(left_n) <= found.half_n(half_n))),
            "points held %": held[each.metadata.condition],
            "offset held %": 100.0 * (missed_n <= found.uncertainty_n) if found.source == STROKES else np.nan,
        }


def points_held(labelled: list[Recording], truths_n: list[Array], known: dict[str, KnownOffset]) -> dict[str, float]:
    """Return how often the interval of a Stribeck point holds that of true friction, by condition [%]."""
    held = {}
    for condition in sorted({each.metadata.condition for each in labelled}):
        own, true, offsets = [], [], []
        for each, truth_n in zip(labelled, truths_n, strict=True):
            if each.metadata.condition == condition:
                offsets.append(found := known[each.metadata.session])
                own.append(each.with_columns(friction_n=each.column("friction_n") - found.correction_n))
                true.append(each.with_columns(friction_n=truth_n))
        points, zeros_n = stribeck_points(own, PLAN.slowest_m_s, 0.95), mean_uncertainty_n(offsets)
        within = [
            abs(mine.friction_n - theirs.friction_n) <= math.hypot(mine.half_width_n, zeros_n)
            for mine, theirs in zip(points, stribeck_points(true, PLAN.slowest_m_s, 0.95), strict=True)
            if mine.known_half_width_n is not None
        ]
        held[condition] = 100.0 * float(np.mean(within)) if within else np.nan
    return held


def sweep(kinds: list[str], seeds: range, sessions: int = 6, duration_s: float = 30.0) -> pd.DataFrame:
    """Return one row per call: means over its recordings, and the ratio of both errors."""
    rows = []
    for name in kinds:
        for seed in seeds:
            cylinder, labelled, truths_n = recordings(KINDS[name], seed, sessions, duration_s)
            for title, places in groupings(labelled, seed):
                call = one_call([labelled[each] for each in places], [truths_n[each] for each in places], cylinder)
                rows.append({"kind": name, "call": title} | pd.DataFrame(list(call)).mean().to_dict())
    table = pd.DataFrame(rows)
    return table.assign(ratio=table["with %"] / table["without %"])


def trained(name: str, seed: int, epochs: int = 10) -> dict[str, float | str]:
    """Return what a hybrid makes of held-out sessions of a campaign."""
    cylinder, labelled, truths_n = recordings(KINDS[name], seed, 6, 60.0)
    by_name = {each.name: truth_n for each, truth_n in zip(labelled, truths_n, strict=True)}
    turns: dict[str, list[Recording]] = {}
    for each in labelled:
        turns.setdefault(each.metadata.condition, []).append(each)
    parts = [[each for own in turns.values() for each in own[some]] for some in (slice(0, 4), slice(4, 5), slice(5, 6))]
    models, _ = training_models(parts[0], cylinder, PLAN)
    parts = [without_offsets(part, models) for part in parts]
    train, validation, held_out = parts
    hybrid = HybridEstimator(cylinder)
    hybrid = HybridEstimator(cylinder, plan=replace(hybrid.plan, epochs=epochs)).fit(train, validation)
    alone = replace(hybrid.step_model(), offset=None)
    rows = []
    for each in held_out:
        newtons, _ = hybrid.real_time().run(each.samples())
        without, _ = RealTimeStream(alone).run(each.samples())
        usable, truth_n = each.usable().copy(), by_name[each.name]
        usable[: hybrid.step_model().guard.warm_up_samples] = False
        level_n, error_n = np.mean(np.abs(truth_n[usable])), np.abs(newtons[:, 0] - truth_n)[usable].mean()
        rows.append(
            {
                "error %": 100.0 * error_n / level_n,
                "without tracker %": 100.0 * np.abs(without[:, 0] - truth_n)[usable].mean() / level_n,
                "held %": 100.0 * ((newtons[:, 1] <= truth_n) & (truth_n <= newtons[:, 2]))[usable].mean(),
                "width over error": (newtons[:, 2] - newtons[:, 1])[usable].mean() / error_n,
            }
        )
    learns = str(hybrid.offset is not None)
    words: dict[str, float | str] = {"kind": name, "zeros taken off": ", ".join(models), "learns": learns}
    return words | {str(key): float(value) for key, value in pd.DataFrame(rows).mean().items()}


def main() -> None:
    """Print the sweep."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", metavar="KIND", nargs="*", default=list(KINDS), help=f"of: {', '.join(KINDS)}")
    parser.add_argument("--seeds", type=int, default=4, help="campaigns of each kind")
    parser.add_argument("--train", action="store_true", help="train a hybrid on each campaign")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    if arguments.train:
        found = [trained(name, seed) for name in arguments.kinds for seed in range(arguments.seeds)]
        print(pd.DataFrame(found).round(2).to_string(index=False))
        return
    table = sweep(arguments.kinds, range(arguments.seeds))
    groups = table.groupby(["kind", "call"], sort=False)
    shown = pd.DataFrame(
        {
            "calls": groups.size(),
            "ratio": groups["ratio"].median(),
            "worst decile": groups["ratio"].quantile(0.9),
            "largest": groups["ratio"].max(),
            "above 1.05 %": groups["ratio"].apply(lambda each: 100.0 * (each > 1.05).mean()),
        }
    ).join(groups[["with %", "without %", "label held %", "points held %", "offset held %"]].mean())
    print(shown.round(2).to_string())
    ratio = table["ratio"]
    print(
        f"{len(table)} calls: worst decile {ratio.quantile(0.9):.3f}, above 1.05: {100.0 * (ratio > 1.05).mean():.1f} "
        f"%, above 1.2: {100.0 * (ratio > 1.2).mean():.1f} %, largest {ratio.max():.2f}; label held "
        f"{table['label held %'].mean():.1f} %, Stribeck points {table['points held %'].mean():.1f} %, offsets "
        f"{table['offset held %'].mean():.1f} %"
    )


if __name__ == "__main__":
    main()
