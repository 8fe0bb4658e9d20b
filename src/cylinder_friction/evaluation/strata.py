"""Strata of motion: at rest, near zero velocity, sliding, just after a reversal, extending, retracting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array, Mask

STRATA = {
    "standstill": "at rest",
    "near_zero": "near zero velocity",
    "sliding": "sliding",
    "after_reversal": "just after a reversal",
    "extend": "extending",
    "retract": "retracting",
}
"""The strata and their names. The first three divide all rows; the others overlap with them."""


@dataclass(frozen=True)
class StrataLimits:
    """Limits of rest, of near zero velocity, and of the time after a reversal."""

    standstill_velocity_m_s: float  # Greatest speed that counts as rest [m/s]
    near_zero_velocity_m_s: float  # Below this speed (and above standstill) a row is near zero velocity [m/s]
    reversal_window_s: float  # Time after a change of direction that counts as just after it [s]


def strata_masks(velocity_m_s: Array, sample_time_s: float, limits: StrataLimits) -> dict[str, Mask]:
    """Mark the rows of each stratum, each mask of shape ``(n,)``.

    A reversal is the first row that moves against the direction of the last row that moved, however long the
    rest between them; its window starts at that row. The velocity is from the zero-phase filter, shape ``(n,)``.
    """
    speed = np.abs(velocity_m_s)
    rest = speed <= limits.standstill_velocity_m_s
    near = ~rest & (speed < limits.near_zero_velocity_m_s)
    return {
        "standstill": rest,
        "near_zero": near,
        "sliding": ~rest & ~near,
        "after_reversal": _after_reversal(velocity_m_s, rest, round(limits.reversal_window_s / sample_time_s)),
        "extend": ~rest & (velocity_m_s > 0.0),
        "retract": ~rest & (velocity_m_s < 0.0),
    }


def _after_reversal(velocity_m_s: Array, rest: Mask, window: int) -> Mask:
    moving = np.flatnonzero(~rest)
    directions = np.sign(velocity_m_s[moving])
    reversals = moving[1:][directions[1:] != directions[:-1]]
    mask = np.zeros(len(velocity_m_s), dtype=np.bool_)
    for row in reversals:
        mask[row : row + window] = True
    return mask
