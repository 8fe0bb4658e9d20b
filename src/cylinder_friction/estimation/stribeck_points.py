"""Points of the Stribeck curve with confidence intervals that know that the rows of one stroke are not independent."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cylinder_friction.friction_models.identification.steady_points import (
    SteadyPoint,
    SteadySliding,
    steady_sliding_by_speed,
)
from cylinder_friction.friction_models.parameters import STRIBECK_EXPONENT
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.inspection.known_curve import is_breakaway_known, known_curve
from cylinder_friction.signals.motion import steady_rows

SLOW_PARAMETERS = ("static_n", "stribeck_velocity_m_s", "stribeck_exponent")
"""What only slow sliding determines."""
LEAST_RISE = 0.05
"""Share of Coulomb friction by which friction of the slowest sliding must exceed it, for its rise to have been seen."""
STEADY_VARIATION = 0.4
"""How much velocity may vary within ``STEADY_DURATION_S``, over its mean, for sliding to count as steady."""
_AT_THE_LIMIT = 0.01


@dataclass(frozen=True)
class StribeckPoint(SteadyPoint):
    """Friction of steady sliding at one speed in one direction, and how well it is known."""

    strokes: int  # How many strokes its rows come from
    half_width_n: float  # Half the width of the confidence interval of ``friction_n`` [N]; NaN for a single stroke

    @property
    def known_half_width_n(self) -> float | None:
        """``half_width_n``, None where it is not known."""
        return None if math.isnan(self.half_width_n) else self.half_width_n


@dataclass(frozen=True)
class IdentifiedCurve:
    """Points of steady sliding in one condition, and the curve through them."""

    condition: str
    recordings: tuple[str, ...]  # Names
    points: tuple[StribeckPoint, ...]
    curve: StribeckCurve | None  # None where the points do not determine one, and ``why_not`` states why
    why_not: str

    @property
    def why_not_slow(self) -> str:
        """Why ``SLOW_PARAMETERS`` of the curve are not determined, empty where they are."""
        assert self.curve is not None
        exponent = self.curve.stribeck_exponent
        if min(exponent - STRIBECK_EXPONENT.lower, STRIBECK_EXPONENT.upper - exponent) < _AT_THE_LIMIT:
            return f"the fit ends at the limit of its exponent, {exponent:.2g}; record more strokes at low speed"
        return no_rise_seen(self.curve, self.points)

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values; what is not known is None."""
        points = [{**asdict(point), "half_width_n": point.known_half_width_n} for point in self.points]
        content: dict[str, Any] = {"recordings": list(self.recordings), "points": points}
        if self.curve is None:
            return content | {"curve": None, "why_not": self.why_not}
        curve: dict[str, float | None] = asdict(self.curve)
        if self.why_not_slow:
            curve |= dict.fromkeys(SLOW_PARAMETERS)
        return content | {"curve": curve, "why_not": self.why_not_slow}


def no_rise_seen(curve: StribeckCurve, points: Sequence[SteadyPoint]) -> str:
    """Return why steady sliding does not determine how friction rises towards standstill, empty where it does."""
    slowest_m_s = min(abs(point.velocity_m_s) for point in points)
    rise = float(curve.dry_friction(np.array([slowest_m_s]))[0]) / curve.coulomb_n - 1.0
    if is_breakaway_known(curve, points) and rise >= LEAST_RISE:
        return ""
    return (
        f"at the slowest steady sliding, {1e3 * slowest_m_s:.2g} mm/s, friction does not rise towards standstill; "
        "record slower strokes"
    )


def identified_curve(
    condition: str, recordings: Sequence[Recording], slowest_m_s: float, confidence: float
) -> IdentifiedCurve:
    """Return the points and the curve of one condition; arguments as for ``stribeck_points``."""
    points = stribeck_points(recordings, slowest_m_s, confidence)
    return IdentifiedCurve(condition, tuple(recording.name for recording in recordings), points, *known_curve(points))


def stribeck_points(
    recordings: Sequence[Recording], slowest_m_s: float, confidence: float
) -> tuple[StribeckPoint, ...]:
    """Return points with intervals, slowest retraction to fastest extension; starts and stops make none.

    Args:
        recordings: With ``velocity_m_s``, ``friction_n`` and ``usable``.
        slowest_m_s: Slower is standstill [m/s].
        confidence: Probability of each interval.
    """
    steady = [_steady(recording, slowest_m_s) for recording in recordings]
    return tuple(_point(rows, confidence) for rows in steady_sliding_by_speed(steady, slowest_m_s))


def _steady(recording: Recording, slowest_m_s: float) -> Recording:
    rows = steady_rows(recording.column("velocity_m_s"), recording.sample_time_s, slowest_m_s, STEADY_VARIATION)
    return recording.with_columns(usable=recording.usable() & rows)


def _point(rows: SteadySliding, confidence: float) -> StribeckPoint:
    """Return the point of some rows.

    What scatters is the median of a stroke, from stroke to stroke, with Student's t for their number; a stroke counts
    by its rows. A single stroke shows no scatter, however many rows it has.
    """
    from scipy.special import stdtrit  # what only estimates need not wait for it

    _, stroke, counts = np.unique(rows.stroke, return_inverse=True, return_counts=True)
    half_width_n = math.nan
    if len(counts) > 1:
        medians = [np.median(rows.friction_n[stroke == number]) for number in range(len(counts))]
        share = counts / counts.sum()
        quantile = float(stdtrit(len(counts) - 1, 0.5 + 0.5 * confidence))
        half_width_n = quantile * float(np.std(medians, ddof=1)) * float(np.linalg.norm(share))
    return StribeckPoint(**vars(rows.point()), strokes=len(counts), half_width_n=half_width_n)
