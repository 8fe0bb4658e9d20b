"""The backlash operator: a gap that the position must cross before it counts as motion.

A velocity threshold takes the noise of a potentiometer for motion and misses creep. Backlash does neither: creep adds
up until it pushes the edge of the gap, and noise narrower than the gap never does.
"""

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled

CENTRE, DIRECTION, AGE = 0, 1, 2
"""Places in the operator's state."""


def new_backlash() -> Array:
    """Make the state before the first position, shape ``(3,)``: centre of the gap, direction of the last push (-1 or 1;
    0 before the first) and its age. The first position becomes the centre."""
    return np.array([np.nan, 0.0, np.inf])


@compiled
def push(position: float, state: Array, half_width: float, centring: float, elapsed: float) -> bool:
    """Advance the operator by one position; return whether that pushed the gap.

    Args:
        position: In any unit.
        state: From ``new_backlash``, changed in place.
        half_width: Half the width of the gap, in the position's unit.
        centring: Fraction of its distance from the position by which the gap recentres first. Noise pushes a gap that
            is at its edge, and not a centred one. 0: the gap does not recentre.
        elapsed: Time since the last position, in the unit of the age.
    """
    if np.isnan(state[CENTRE]):
        state[CENTRE] = position
    if centring > 0.0:
        state[CENTRE] += centring * (position - state[CENTRE])
    if position > state[CENTRE] + half_width:
        state[CENTRE], state[DIRECTION], state[AGE] = position - half_width, 1.0, 0.0
    elif position < state[CENTRE] - half_width:
        state[CENTRE], state[DIRECTION], state[AGE] = position + half_width, -1.0, 0.0
    else:
        state[AGE] += elapsed
        return False
    return True


@compiled
def pushing_velocity(
    velocity: float, position: float, state: Array, half_width: float, lasting: float, centring: float, elapsed: float
) -> float:
    """Gate a velocity: it counts while the position has recently pushed the gap in its direction, else it is 0.

    Args:
        velocity: Filtered velocity.
        position: Filtered position; the other arguments are those of ``push``, which this calls.
        lasting: Age of the last push at which the velocity becomes zero.
    """
    push(position, state, half_width, centring, elapsed)
    return velocity if state[AGE] < lasting and velocity * state[DIRECTION] > 0.0 else 0.0
