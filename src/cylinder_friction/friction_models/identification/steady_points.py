"""Strokes at constant velocity in labelled recordings, collected into points of the Stribeck curve."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.friction_models.stribeck import CURVE_PARAMETERS, StribeckCurve, fit_stribeck
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import steady_rows, travel_since_stop

PRESLIDING_TRAVEL_M = 1e-3
"""Travel after standstill or reversal beyond which bristles no longer bend [m]: several times a seal's deflection."""

LEAST_SPEED_M_S = 1e-4
"""Lowest speed of the bins [m/s], even if the dead band is smaller."""

STEADY_VARIATIONS = (0.1, 0.2, 0.4, 0.8)
"""Tolerances of ``steady_rows``, tried from the strictest until one leaves enough rows."""
BINS, ROWS_PER_POINT = 12, 40
"""Bins of speed in each direction, and the least rows of one."""
LEAST_SPAN = 5.0
"""Smallest ratio of the fastest to the slowest steady speed at which a curve's level and slope can be separated."""
BELOW_SEEN = 0.6
"""Smallest plausible Coulomb friction, as a share of the least friction seen, which includes viscous friction."""
OPPOSING = 0.7
"""Smallest share of points whose friction must oppose the motion."""


@dataclass(frozen=True)
class SteadyPoint:
    """Friction of steady sliding at one speed in one direction."""

    velocity_m_s: float  # Median velocity, positive while extending [m/s]
    friction_n: float  # Median friction, positive when it opposes positive velocity [N]
    # Quartiles of that friction [N]
    lower_quartile_n: float
    upper_quartile_n: float
    rows: int  # Number of samples


@dataclass(frozen=True)
class StribeckPoint(SteadyPoint):
    """Friction of steady sliding at one speed in one direction, with its confidence interval."""

    strokes: int  # Number of strokes that its rows come from
    half_width_n: float  # Half the width of the confidence interval of ``friction_n`` [N]; NaN or infinite if unknown

    @property
    def known_half_width_n(self) -> float | None:
        """``half_width_n``, or None if it is unknown, as that of a single stroke."""
        return self.half_width_n if math.isfinite(self.half_width_n) else None


@dataclass(frozen=True)
class SteadySliding:
    """Rows of steady sliding at about one speed in one direction."""

    # Shape ``(rows,)``
    velocity_m_s: Array  # Positive while extending
    friction_n: Array  # Positive when it opposes positive velocity
    stroke: NDArray[np.int64]  # Number of the stroke that each row belongs to, counted over all recordings

    def point(self) -> SteadyPoint:
        """Summarise the rows by medians and quartiles."""
        lower_n, middle_n, upper_n = np.quantile(self.friction_n, [0.25, 0.5, 0.75]).tolist()
        return SteadyPoint(float(np.median(self.velocity_m_s)), middle_n, lower_n, upper_n, len(self.velocity_m_s))

    def point_with_interval(self, confidence: float) -> StribeckPoint:
        """Summarise the rows, with the confidence interval of friction at this probability.

        The interval comes from the scatter of the strokes' medians, weighted by their rows, with Student's t for the
        number of strokes. A single stroke shows no scatter, however many rows it has.
        """
        from scipy.special import stdtrit  # slow to import

        _, stroke, counts = np.unique(self.stroke, return_inverse=True, return_counts=True)
        half_width_n = math.nan
        if len(counts) > 1:
            medians = [np.median(self.friction_n[stroke == number]) for number in range(len(counts))]
            share = counts / counts.sum()
            quantile = float(stdtrit(len(counts) - 1, 0.5 + 0.5 * confidence))
            half_width_n = quantile * float(np.std(medians, ddof=1)) * float(np.linalg.norm(share))
        return StribeckPoint(**vars(self.point()), strokes=len(counts), half_width_n=half_width_n)

    def where(self, rows: Mask) -> SteadySliding:
        """Select rows by a mask."""
        return SteadySliding(self.velocity_m_s[rows], self.friction_n[rows], self.stroke[rows])


def steady_points(recordings: Sequence[Recording], slowest_m_s: float) -> list[SteadyPoint]:
    """Summarise each group of ``steady_sliding_by_speed`` as one point of the friction-velocity curve."""
    return [each.point() for each in steady_sliding_by_speed(recordings, slowest_m_s)]


def steady_sliding_by_speed(recordings: Sequence[Recording], slowest_m_s: float) -> list[SteadySliding]:
    """Group the rows of steady sliding by speed, from the fastest retraction to the fastest extension.

    Speeds are binned on a logarithmic scale, separately for each direction. A hand never moves at exactly constant
    velocity, so the tolerance is widened until both directions have at least half the bins filled. If even the widest
    tolerance leaves fewer points than a curve has parameters, as in recordings of a few seconds, every row beyond
    presliding counts. Rows slower than ``slowest_m_s`` are at standstill.
    """
    slowest_m_s = max(slowest_m_s, LEAST_SPEED_M_S)
    found: list[SteadySliding] = []
    slid = [_has_slid(recording, slowest_m_s) for recording in recordings]
    for variation in STEADY_VARIATIONS:
        masks = [
            mask & steady_rows(recording.column("velocity_m_s"), recording.sample_time_s, slowest_m_s, variation)
            for recording, mask in zip(recordings, slid, strict=True)
        ]
        found = _by_speed(_joined(recordings, slid, masks), slowest_m_s, ROWS_PER_POINT)
        if min(sum(bool(each.velocity_m_s[0] * way > 0.0) for each in found) for way in (-1.0, 1.0)) >= BINS // 2:
            return found
    if len(found) < CURVE_PARAMETERS:
        found = _by_speed(_joined(recordings, slid, slid), slowest_m_s, ROWS_PER_POINT // 4)
    return found


def _has_slid(recording: Recording, slowest_m_s: float) -> Mask:
    travel_m = travel_since_stop(recording.column("velocity_m_s"), slowest_m_s, recording.sample_time_s)
    return np.asarray(recording.usable() & (travel_m > PRESLIDING_TRAVEL_M))


def _joined(recordings: Sequence[Recording], slid: Sequence[Mask], masks: Sequence[Mask]) -> SteadySliding:
    """Join the masked rows of all recordings; an unbroken run of rows that have slid is one stroke."""
    chosen = np.concatenate(masks)
    return SteadySliding(
        np.concatenate([recording.column("velocity_m_s") for recording in recordings]),
        np.concatenate([recording.column("friction_n") for recording in recordings]),
        np.cumsum(np.concatenate([np.diff(mask, prepend=False) & mask for mask in slid])),
    ).where(chosen)


def _by_speed(rows: SteadySliding, slowest_m_s: float, rows_per_point: int) -> list[SteadySliding]:
    both_ways = [_binned(rows.where(rows.velocity_m_s * way > 0.0), slowest_m_s, rows_per_point) for way in (-1.0, 1.0)]
    return both_ways[0][::-1] + both_ways[1]


def _binned(one_way: SteadySliding, slowest_m_s: float, rows_per_point: int) -> list[SteadySliding]:
    """Bin rows by speed, slowest first; bins with too few rows are left out."""
    speed = np.abs(one_way.velocity_m_s)
    if len(speed) < rows_per_point:
        return []
    edges = np.geomspace(slowest_m_s, np.nextafter(float(speed.max()), np.inf), BINS + 1)
    numbers = np.clip(np.digitize(speed, edges) - 1, 0, BINS - 1)
    return [one_way.where(numbers == number) for number in range(BINS) if (numbers == number).sum() >= rows_per_point]


def known_curve(points: Sequence[SteadyPoint]) -> tuple[StribeckCurve | None, str]:
    """Fit a curve through points of steady sliding; return None and the reason if they do not determine one."""
    if points and (problem := undetermined(points)):
        return None, problem
    try:
        curve = curve_through(points)
    except ValueError as error:
        return None, str(error)
    problem = _beyond_seen(curve, points)
    return (None, problem) if problem else (curve, "")


def is_breakaway_known(curve: StribeckCurve, points: Sequence[SteadyPoint]) -> bool:
    """Check whether a point is as slow as the Stribeck velocity; if none is, static friction is extrapolated."""
    return min(abs(point.velocity_m_s) for point in points) <= curve.stribeck_velocity_m_s


def undetermined(points: Sequence[SteadyPoint]) -> str:
    """Explain why points of steady sliding do not determine friction; empty if they do. At least one is needed."""
    opposing = [point for point in points if point.friction_n * point.velocity_m_s > 0.0]
    if len(opposing) < OPPOSING * len(points):
        return (
            f"only {len(opposing)} of {len(points)} points of steady sliding oppose the motion, as friction must; the "
            "force carries a load, the position counts the other way, or the pressures are swapped"
        )
    if len({point.velocity_m_s > 0.0 for point in points}) == 1:
        way = "extending" if points[0].velocity_m_s > 0.0 else "retracting"
        return f"steady sliding was seen while {way} alone; record strokes in both directions"
    speeds = [abs(point.velocity_m_s) for point in points]
    span = max(speeds) / min(speeds)
    if span < LEAST_SPAN:
        return (
            f"speeds of steady sliding run from {1e3 * min(speeds):.2g} to {1e3 * max(speeds):.2g} mm/s, a factor of "
            f"{span:.2g}; Coulomb and viscous friction can be separated from a factor of {LEAST_SPAN:.2g}; record "
            "slower and faster strokes"
        )
    return ""


def curve_through(points: Sequence[SteadyPoint]) -> StribeckCurve:
    """Fit the curve, with each point weighted by the square root of its rows; raise as ``fit_stribeck`` does."""
    names = ("velocity_m_s", "friction_n", "rows")
    velocity, friction, rows = (np.array([getattr(each, name) for each in points], dtype=np.float64) for name in names)
    return fit_stribeck(velocity, friction, np.sqrt(rows))


def _beyond_seen(curve: StribeckCurve, points: Sequence[SteadyPoint]) -> str:
    seen = [abs(point.friction_n) for point in points]
    coulomb = sorted((curve.coulomb_n, curve.retract_ratio * curve.coulomb_n))
    if coulomb[0] >= BELOW_SEEN * min(seen) and coulomb[1] <= max(seen):
        return ""
    return (
        f"the fit's Coulomb friction, {coulomb[0]:.0f} to {coulomb[1]:.0f} N, lies outside the force of steady "
        f"sliding, {min(seen):.0f} to {max(seen):.0f} N, so its parameters are not determined; record more strokes at "
        "constant velocity"
    )
