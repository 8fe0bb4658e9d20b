"""Which way a position sensor counts, from the work that the pressures do: friction takes work, it gives none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.mapping.unit_spelling import electrical

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.recordings.mapping.channel_facts import ChannelFacts

    Array = NDArray[np.float64]

AREA_RATIOS = (0.5, 0.7, 0.9)
"""A2 over A1, which nobody has told yet: the sign must be the same for all of them."""

STROKE_SHARE = 0.02
"""Steps over which direction is judged are this share of the travel, so that noise does not count as motion."""


def position_sign(chosen: dict[str, ChannelFacts]) -> tuple[int, str]:
    """Return 1, or -1 with a sentence for the user where the position seems to count the other way.

    With F = P1 - r·P2, any load that depends on position alone is fitted away with a cubic; what is left must go
    with the direction.
    """
    channels = [chosen.get(column) for column in ("pressure_1_pa", "pressure_2_pa", "position_m")]
    if any(channel is None for channel in channels):
        return 1, ""
    known = [channel for channel in channels if channel is not None]
    if len({(channel.table, len(channel.values)) for channel in known}) > 1 or known[0].unit != known[1].unit:
        return 1, ""
    if any(electrical(channel.unit) is not None for channel in known[:2]):
        return 1, ""
    finite = np.isfinite([channel.values for channel in known]).all(axis=0)
    first, second, position = (channel.values[finite] for channel in known)
    turns = [_goes_with_direction(first - ratio * second, position) for ratio in AREA_RATIOS]
    if all(turn < 0.0 for turn in turns):
        return -1, (
            "sign -1 because the pressures push against the motion, so that friction would drive the piston; it is 1 "
            "if the two pressures are swapped instead"
        )
    return 1, ""


def _goes_with_direction(force: Array, position: Array) -> float:
    """Return the part of a force that turns with the direction of motion, 0 where that cannot be told."""
    travel = float(np.ptp(position)) if len(position) else 0.0
    if travel == 0.0:
        return 0.0
    rows = _rows_of_motion(position, STROKE_SHARE * travel)
    direction = np.sign(np.diff(position[rows]))
    middle = (rows[:-1] + rows[1:]) // 2
    if min((direction > 0).sum(), (direction < 0).sum()) < 5:
        return 0.0
    scaled = (position[middle] - position.min()) / travel
    columns = np.column_stack([np.ones_like(scaled), scaled, scaled**2, scaled**3, direction])
    solution = np.linalg.lstsq(columns, force[middle], rcond=None)[0]
    left = force[middle] - columns @ solution
    uncertainty = float(np.std(left)) / np.sqrt(len(left))
    return float(solution[-1]) if abs(solution[-1]) > 4.0 * uncertainty else 0.0


def _rows_of_motion(position: Array, step: float) -> NDArray[np.intp]:
    """Return the rows at which the position has moved on by ``step`` since the last such row."""
    levels = np.floor((position - position.min()) / step)
    changed = np.flatnonzero(np.diff(levels) != 0.0) + 1
    return np.asarray(np.concatenate([[0], changed]), dtype=np.intp)
