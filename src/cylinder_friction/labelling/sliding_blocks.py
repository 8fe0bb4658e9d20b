"""Blocks of steady sliding, from which the offset of a session's sensors is identified."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.uncertainty import sensitivities
from cylinder_friction.recordings.columns import LOAD_FORCE, OIL_TEMPERATURE, PRESSURE_1, PRESSURE_2
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.signals.motion import direction_of_motion, stroke_pieces

EXPLAINING = (PRESSURE_1, PRESSURE_2, LOAD_FORCE, OIL_TEMPERATURE)
"""Columns that may explain friction beside speed and position."""

LOADED = {"position": "a load identified from position has absorbed the sensors' offset"}
"""Reason why offsets are not identified if there is a load, by the load's mode."""
POSITION_BINS = 30
LEAST_ROWS_A_BIN = 10
LOAD_SHARE = 0.5
"""Share of friction above which a force that does not turn with the direction counts as a load."""


@dataclass(frozen=True)
class OffsetPlan:
    """Settings for the identification of sensor offsets.

    Raises:
        ValueError: A number is out of its range.
    """

    slowest_m_s: float = 6e-3  # Speed below which rows are ignored, as friction depends on its history [m/s]
    settling_s: float = 0.2  # Time after a start or reversal that is ignored [s]
    block_s: float = 0.1  # Duration of a block [s]
    # Standard uncertainty of the asymmetry common to all sessions: half the difference of friction between the
    # directions, over mean friction
    asymmetry: float = 0.15
    # Least standard deviation, from session to session, of the ratio of friction retracting to friction extending
    asymmetry_sd: float = 0.005
    # Time in which a sensor's zero may drift by its stated uncertainty, for the real-time tracker [s]
    drift_s: float = 3600.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            positive = name in ("slowest_m_s", "block_s", "drift_s")
            if not (math.isfinite(value) and (value > 0.0 if positive else value >= 0.0)):
                expected = "a positive number" if positive else "zero or a positive number"
                raise ValueError(f"OffsetPlan: {name} must be {expected}, but got {value!r}")


@dataclass(frozen=True)
class SlidingBlocks:
    """Blocks of steady sliding of one recording or session, from which its offset is identified."""

    session: str
    prior_n: float  # Stated standard uncertainty of the sensors' zeros, as friction [N]
    kept_n: float  # Part of ``prior_n`` that sensors may keep from session to session [N]
    sliding_s: float  # Duration of the steady sliding [s]
    # Of each block, shape ``(blocks,)``: mean label [N], direction, and number of the stroke, counted from 0
    label_n: Array
    direction: Array
    stroke: NDArray[np.int64]
    columns: dict[str, Array]  # Mean over each block of each column that may explain friction
    condition: str = ""

    @property
    def level_n(self) -> float:
        """Mean absolute label [N]."""
        return float(np.mean(np.abs(self.label_n)))

    def halves_n(self) -> tuple[float, float]:
        """Compute half the sum and half the difference of the mean label extending and retracting [N]; else NaN."""
        ways = [self.label_n[self.direction == sign] for sign in (1.0, -1.0)]
        if not min(map(len, ways)):
            return math.nan, math.nan
        extend_n, retract_n = (float(way.mean()) for way in ways)
        return 0.5 * (extend_n + retract_n), 0.5 * (extend_n - retract_n)

    @classmethod
    def together(cls, parts: Sequence[Self]) -> Self:
        """Join the sliding of several recordings or sessions in their order, under the name of the first."""
        before = np.cumsum([0, *(1 + int(part.stroke.max(initial=-1)) for part in parts)])
        common = [name for name in parts[0].columns if all(name in part.columns for part in parts)]
        return cls(
            parts[0].session,
            max(part.prior_n for part in parts),
            max(part.kept_n for part in parts),
            sum(part.sliding_s for part in parts),
            np.concatenate([part.label_n for part in parts]),
            np.concatenate([part.direction for part in parts]),
            np.concatenate([part.stroke + first for part, first in zip(parts, before[:-1], strict=True)]),
            {name: np.concatenate([part.columns[name] for part in parts]) for name in common},
            parts[0].condition,
        )


def sliding_blocks(
    recording: Recording, cylinder: Cylinder, plan: OffsetPlan | None = None, prior_n: float | None = None
) -> SlidingBlocks:
    """Find the steady sliding of a labelled recording; without ``prior_n``, use the stated uncertainty of its zeros.

    Raises:
        RecordingError: The recording lacks labels, or the uncertainty of a sensor's zero is not stated.
    """
    plan, prior_n = plan or OffsetPlan(), zero_uncertainty_n(recording, cylinder) if prior_n is None else prior_n
    if prior_n is None:
        raise RecordingError(unstated_zero(recording, cylinder))
    names = ["friction_n", "velocity_m_s", "position_m"]
    names += [each for each in EXPLAINING if each in recording.columns]
    velocity_m_s, step_s = recording.column("velocity_m_s"), recording.sample_time_s
    direction = np.where(recording.usable(), direction_of_motion(velocity_m_s, plan.slowest_m_s), 0.0)
    size = max(1, round(plan.block_s / step_s))
    pieces = stroke_pieces(direction, step_s * np.arange(len(direction), dtype=np.float64), plan.settling_s, size)
    whole = 2 * pieces.counts >= size
    label_n = pieces.mean(recording.column("friction_n"))
    of_stroke_n = pd.Series(label_n[whole]).groupby(pieces.stroke[whole]).transform("median").to_numpy()
    # A force as large as friction that acts in a part of a stroke, as of a cushion, is no zero
    usual_n = float(np.median(np.abs(of_stroke_n))) if len(of_stroke_n) else 0.0
    whole[whole] = np.abs(label_n[whole] - of_stroke_n) <= usual_n
    means = {name: pieces.mean(recording.column(name))[whole] for name in names}
    return SlidingBlocks(
        recording.metadata.session,
        prior_n,
        min(kept_zeros_n(recording, cylinder), prior_n),
        float(pieces.counts[whole].sum()) * step_s,
        means.pop("friction_n"),
        np.sign(means["velocity_m_s"]),
        np.unique(pieces.stroke[whole], return_inverse=True)[1].astype(np.int64),
        means,
        recording.metadata.condition,
    )


def unstated_zero(recording: Recording, cylinder: Cylinder) -> str:
    """Name a sensor whose zero is not stated, and what to do; empty if all zeros are stated."""
    stated = recording.metadata.uncertainty
    column = next((each for each in sensor_areas(recording, cylinder) if each not in stated), "")
    if not column:
        return ""
    instead = (
        "state sensor.accuracy_percent or sensor.zero_uncertainty of the load cell in the mapping; "
        f"without a load cell, {LOADED['position']}"
        if column == LOAD_FORCE
        else "state sensor.accuracy_percent or sensor.zero_uncertainty in the mapping"
    )
    return (
        f"recording {recording.name!r}: the uncertainty of the zero of {column!r} is not stated; expected that "
        f"of every sensor behind the label, as it limits the offset; {instead}"
    )


def zero_uncertainty_n(recording: Recording, cylinder: Cylinder) -> float | None:
    """Compute a label's standard uncertainty from the stated zeros of its sensors [N]; None if one is not stated."""
    stated = recording.metadata.uncertainty
    areas = sensor_areas(recording, cylinder)
    if any(column not in stated for column in areas):
        return None
    return math.sqrt(sum((area * stated[column].zero) ** 2 for column, area in areas.items()))


def kept_zeros_n(recording: Recording, cylinder: Cylinder) -> float:
    """Compute the part of ``zero_uncertainty_n`` [N] that is the same in all sessions of sensors that keep their zeros.

    Sensors that state no zero do not count.
    """
    stated = recording.metadata.uncertainty
    kept = (
        area * stated[column].zero
        for column, area in sensor_areas(recording, cylinder).items()
        if column in stated and not stated[column].zeroed
    )
    return math.hypot(*kept)


def sensor_areas(recording: Recording, cylinder: Cylinder) -> dict[str, float]:
    """Compute the label's derivative by each sensor's zero, including a measured load's [m², or 1 for a force]."""
    load = {LOAD_FORCE: -1.0} if LOAD_FORCE in recording.columns else {}
    return sensitivities(recording, cylinder) | load


def holds_load(load_n: float, half_difference_n: float) -> bool:
    """Check whether a force contains a load, from the result of ``up_and_down``; False if that is unknown."""
    return abs(load_n) > LOAD_SHARE * abs(half_difference_n)


def up_and_down(
    position_m: Array, velocity_m_s: Array, friction_n: Array, usable: NDArray[np.bool_], slowest_m_s: float
) -> tuple[float, float]:
    """Compute the medians of half the sum and half the difference of the force up and down at equal positions [N].

    A force that depends on position alone, such as a load's weight, appears in the sum, not in the difference.
    """
    moving = np.flatnonzero(usable & (np.abs(velocity_m_s) > slowest_m_s))
    down = velocity_m_s[moving] < 0.0
    if down.all() or not down.any():
        return float("nan"), float("nan")
    within_m = position_m[usable]
    edges = np.linspace(float(within_m.min()), float(within_m.max()), POSITION_BINS + 1)
    bins = np.searchsorted(edges[1:-1], position_m[moving], side="right") + POSITION_BINS * down
    medians_n, counts = _medians(friction_n[moving], bins.astype(np.uint8), 2 * POSITION_BINS)
    both = (counts.reshape(2, -1) >= LEAST_ROWS_A_BIN).all(axis=0)
    if not both.any():
        return float("nan"), float("nan")
    extending_n, retracting_n = medians_n.reshape(2, -1)[:, both]
    return float(np.median(0.5 * (extending_n + retracting_n))), float(np.median(0.5 * (extending_n - retracting_n)))


def unknown_friction(recording: Recording, plan: OffsetPlan, cylinder: Cylinder) -> str:
    """State why ``up_and_down`` finds no friction in a labelled recording, and what to check."""
    speed_mm_s, travel_mm = (1e3 * recording.column(name) for name in ("velocity_m_s", "position_m"))
    speed_mm_s = speed_mm_s[recording.usable()]
    out, back = (f"{(way * speed_mm_s).max(initial=0.0):.3g} mm/s" for way in (1.0, -1.0))
    travel = f"{travel_mm.min():.4g} to {travel_mm.max():.4g} mm of a stroke of {1e3 * cylinder.stroke_m:g} mm"
    return (
        f"no position is passed both ways faster than {1e3 * plan.slowest_m_s:g} mm/s (away from the end stops, at "
        f"most {out} extending and {back} retracting; position_m goes from {travel}); check unit, sign and offset of "
        "position_m, or record strokes both ways over the same travel"
    )


def _medians(values: Array, bins: NDArray[np.uint8], count: int) -> tuple[Array, NDArray[np.int64]]:
    """Compute each bin's median and number of values, ``(count,)``; the median of an empty bin is arbitrary."""
    counts, order = np.bincount(bins, minlength=count), np.argsort(values)
    ordered = values[order[np.argsort(bins[order], kind="stable")]]  # small numbers sort fast
    starts = np.minimum(np.cumsum(counts) - counts, len(values) - 1)
    below, above = (ordered[starts + middle] for middle in (np.maximum(counts - 1, 0) // 2, counts // 2))
    return 0.5 * (below + above), counts
