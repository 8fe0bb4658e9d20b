"""Where in the motion a row lies: at rest, near zero velocity, sliding, just after a reversal, out or in."""

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
"""Every stratum and its name in words. The first three split all rows; the others overlap with them."""


@dataclass(frozen=True)
class StrataLimits:
    """What counts as at rest, near zero, and just after a reversal."""

    standstill_velocity_m_s: float  # At or below this speed the piston counts as at rest [m/s]
    near_zero_velocity_m_s: float  # Below this speed (and above standstill) a row is near zero velocity [m/s]
    reversal_window_s: float  # How long after a change of direction a row counts as just after it [s]


def strata_masks(velocity_m_s: Array, sample_time_s: float, limits: StrataLimits) -> dict[str, Mask]:
    """Return one mask per stratum, each of shape ``(n,)``.

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
