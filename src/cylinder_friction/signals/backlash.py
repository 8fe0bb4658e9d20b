"""The play: a gap that the position must cross before it counts as motion, as between a pin and its slotted hole.

A velocity threshold takes the noise of a potentiometer for motion and misses creep. A play does neither: creep adds up
until it pushes the edge of the gap, and noise narrower than the gap never does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numba
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

CENTRE, DIRECTION, AGE = 0, 1, 2
"""Places in the state of a play."""


def new_play() -> Array:
    """Return the play before the first position, shape ``(3,)``: its centre, the direction of the last push (-1, 1, or
    0 before the first) and the age of that push. The first position becomes the centre."""
    return np.array([np.nan, 0.0, np.inf])


@numba.njit(cache=True)
def push(position: float, play: Array, half_width: float, centring: float, elapsed: float) -> bool:
    """Move the play with the next position; returns whether that pushed it.

    Args:
        position: In any unit.
        play: From ``new_play``, changed in place.
        half_width: Of the gap, in the position's unit.
        centring: Share of its distance from the position by which the gap closes up first: at its edge the least noise
            pushes, in its middle none does. 0: it stays where it was pushed.
        elapsed: Since the last position, in the unit of the age.
    """
    if np.isnan(play[CENTRE]):
        play[CENTRE] = position
    if centring > 0.0:
        play[CENTRE] += centring * (position - play[CENTRE])
    if position > play[CENTRE] + half_width:
        play[CENTRE], play[DIRECTION], play[AGE] = position - half_width, 1.0, 0.0
    elif position < play[CENTRE] - half_width:
        play[CENTRE], play[DIRECTION], play[AGE] = position + half_width, -1.0, 0.0
    else:
        play[AGE] += elapsed
        return False
    return True
