"""Strokes at constant velocity found in labelled recordings, gathered into points of the Stribeck curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.friction_models.stribeck import CURVE_PARAMETERS
from cylinder_friction.signals.motion import steady_rows, travel_since_stop

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.arrays import Array, Mask
    from cylinder_friction.recordings.recording import Recording

PRESLIDING_TRAVEL_M = 1e-3
"""Travel since standstill or reversal after which bristles no longer bend; several times the deflection of seals."""

LEAST_SPEED_M_S = 1e-4
"""Lower edge of the bins, however small the dead band is."""

STEADY_VARIATIONS = (0.1, 0.2, 0.4, 0.8)
"""Tolerances of ``steady_rows``, of which the strictest that leaves enough rows is used."""


@dataclass(frozen=True)
class SteadyPoint:
    """Friction of steady sliding at one speed in one direction."""

    velocity_m_s: float  # Median velocity, positive while extending [m/s]
    friction_n: float  # Median friction, positive when it opposes positive velocity [N]
    # Quartiles of that friction [N]
    lower_quartile_n: float
    upper_quartile_n: float
    rows: int  # How many samples the point stands for


def _has_slid(recording: Recording, slowest_m_s: float) -> Mask:
    travel_m = travel_since_stop(recording.column("velocity_m_s"), slowest_m_s, recording.sample_time_s)
    return np.asarray(recording.usable() & (travel_m > PRESLIDING_TRAVEL_M))


def steady_points(
    recordings: Sequence[Recording], slowest_m_s: float, bins: int = 12, rows_per_point: int = 40
) -> list[SteadyPoint]:
    """Return points of the friction-velocity curve, slowest retraction to fastest extension.

    Speeds are binned on a logarithmic scale, separately for each direction, and a bin gives the medians of its rows.
    A hand never moves at exactly constant velocity, so that the tolerance is widened until both directions have at
    least half the bins filled. Where even the widest leaves fewer points than a curve has parameters, as in recordings
    of a few seconds, every row beyond presliding counts. Rows slower than ``slowest_m_s`` are at standstill.
    """
    slowest_m_s = max(slowest_m_s, LEAST_SPEED_M_S)
    points: list[SteadyPoint] = []
    slid = [_has_slid(recording, slowest_m_s) for recording in recordings]
    for variation in STEADY_VARIATIONS:
        masks = [
            mask & steady_rows(recording.column("velocity_m_s"), recording.sample_time_s, slowest_m_s, variation)
            for recording, mask in zip(recordings, slid, strict=True)
        ]
        points = _points(recordings, masks, slowest_m_s, bins, rows_per_point)
        if min(sum(point.velocity_m_s * way > 0.0 for point in points) for way in (-1.0, 1.0)) >= bins // 2:
            return points
    if len(points) < CURVE_PARAMETERS:
        points = _points(recordings, slid, slowest_m_s, bins, rows_per_point // 4)
    return points


def _points(
    recordings: Sequence[Recording],
    masks: Sequence[Mask],
    slowest_m_s: float,
    bins: int,
    rows_per_point: int,
) -> list[SteadyPoint]:
    velocity, friction = _joined(recordings, masks, "velocity_m_s"), _joined(recordings, masks, "friction_n")
    both_ways = [_binned(velocity, friction, way, slowest_m_s, bins, rows_per_point) for way in (-1.0, 1.0)]
    return sorted(both_ways[0] + both_ways[1], key=lambda point: point.velocity_m_s)


def _joined(recordings: Sequence[Recording], masks: Sequence[Mask], column: str) -> Array:
    return np.concatenate([recording.column(column)[mask] for recording, mask in zip(recordings, masks, strict=True)])


def _binned(
    velocity: Array, friction: Array, direction: float, slowest_m_s: float, bins: int, rows_per_point: int
) -> list[SteadyPoint]:
    one_way = velocity * direction > 0.0
    velocity, friction = velocity[one_way], friction[one_way]
    if len(velocity) < rows_per_point:
        return []
    speed = np.abs(velocity)
    edges = np.geomspace(slowest_m_s, np.nextafter(float(speed.max()), np.inf), bins + 1)
    numbers = np.clip(np.digitize(speed, edges) - 1, 0, bins - 1)
    points = []
    for number in range(bins):
        rows = numbers == number
        if rows.sum() >= rows_per_point:
            quartiles = np.quantile(friction[rows], [0.25, 0.5, 0.75])
            points.append(
                SteadyPoint(
                    velocity_m_s=float(np.median(velocity[rows])),
                    friction_n=float(quartiles[1]),
                    lower_quartile_n=float(quartiles[0]),
                    upper_quartile_n=float(quartiles[2]),
                    rows=int(rows.sum()),
                )
            )
    return points
