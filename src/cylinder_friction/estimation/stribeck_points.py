"""Points of the Stribeck curve, with confidence intervals for rows that are not independent within a stroke."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np

from cylinder_friction.friction_models.identification.known_curve import is_breakaway_known
from cylinder_friction.friction_models.identification.steady_points import (
    SteadyPoint,
    StribeckPoint,
    steady_sliding_by_speed,
)
from cylinder_friction.friction_models.parameters import STRIBECK_EXPONENT
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.labelling.apparent_loss import ApparentLoss
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import steady_rows

SLOW_PARAMETERS = ("static_n", "stribeck_velocity_m_s", "stribeck_exponent")
"""Parameters that only slow sliding determines."""
LEAST_RISE = 0.05
"""Friction rises towards standstill if the slowest sliding exceeds Coulomb friction by this share of it."""
STEADY_VARIATION = 0.4
"""Greatest variation of velocity within ``STEADY_DURATION_S``, over its mean, while sliding counts as steady."""
_AT_THE_LIMIT = 0.01


@dataclass(frozen=True)
class IdentifiedCurve:
    """Points of steady sliding in one condition, and the curve through them."""

    condition: str
    recordings: tuple[str, ...]  # Names of the recordings
    points: tuple[StribeckPoint, ...]
    curve: StribeckCurve | None  # None if the points do not determine a curve
    why_not: str  # Why there is no curve
    no_viscous: str = ""  # Why viscous friction is not known; empty if it is

    def with_loss(self, loss: ApparentLoss) -> Self:
        """Widen the points by an unstated loss between sensors and cylinder, which also hides viscous friction."""
        points = [
            replace(each, half_width_n=each.half_width_n + float(loss.most_n(np.array(each.velocity_m_s))))
            for each in self.points
        ]
        return replace(self, points=tuple(points), no_viscous=loss.unknown_viscous)

    @property
    def why_not_slow(self) -> str:
        """Reason why the curve's ``SLOW_PARAMETERS`` are not determined; empty if they are."""
        assert self.curve is not None
        exponent = self.curve.stribeck_exponent
        if min(exponent - STRIBECK_EXPONENT.lower, STRIBECK_EXPONENT.upper - exponent) < _AT_THE_LIMIT:
            return f"the fit ends at the limit of its exponent, {exponent:.2g}; record more strokes at low speed"
        return no_rise_seen(self.curve, self.points)

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values; unknown values are None."""
        points = [{**asdict(point), "half_width_n": point.known_half_width_n} for point in self.points]
        content: dict[str, Any] = {"recordings": list(self.recordings), "points": points}
        if self.curve is None:
            return content | {"curve": None, "why_not": self.why_not}
        curve: dict[str, float | None] = asdict(self.curve)
        if self.why_not_slow:
            curve |= dict.fromkeys(SLOW_PARAMETERS)
        if self.no_viscous:
            curve["viscous_n_s_m"] = None
        return content | {"curve": curve, "why_not": "; ".join(filter(None, (self.why_not_slow, self.no_viscous)))}


def no_rise_seen(curve: StribeckCurve, points: Sequence[SteadyPoint]) -> str:
    """State why steady sliding does not show how friction rises towards standstill; empty if it does."""
    slowest_m_s = min(abs(point.velocity_m_s) for point in points)
    rise = float(curve.dry_friction(np.array([slowest_m_s]))[0]) / curve.coulomb_n - 1.0
    if is_breakaway_known(curve, points) and rise >= LEAST_RISE:
        return ""
    return (
        f"at the slowest steady sliding, {1e3 * slowest_m_s:.2g} mm/s, friction does not rise towards standstill; "
        "record slower strokes"
    )


def stribeck_points(
    recordings: Sequence[Recording], slowest_m_s: float, confidence: float, zeros_n: float = 0.0
) -> tuple[StribeckPoint, ...]:
    """Compute points with intervals, in the order of velocity. Starts and stops of strokes are not used.

    Args:
        recordings: Recordings with ``velocity_m_s``, ``friction_n`` and ``usable``.
        slowest_m_s: Speed below which the piston counts as at rest [m/s].
        confidence: Probability of each interval.
        zeros_n: How far the sensors' zeros may shift all points [N]; part of each interval.
    """
    steady = []
    for each in recordings:
        rows = steady_rows(each.column("velocity_m_s"), each.sample_time_s, slowest_m_s, STEADY_VARIATION)
        steady.append(each.with_columns(usable=each.usable() & rows))
    points = [rows.point_with_interval(confidence) for rows in steady_sliding_by_speed(steady, slowest_m_s)]
    return tuple(replace(each, half_width_n=math.hypot(each.half_width_n, zeros_n)) for each in points)
