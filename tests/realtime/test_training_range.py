"""What was taught is in the range, a little more is, and nothing further."""

import numpy as np

from cylinder_friction.realtime.guard import TrainingRange
from cylinder_friction.realtime.position_load import PositionLoad

RANGE = TrainingRange(("position_m", "velocity_m_s"), (0.0, -0.1), (0.2, 0.3))


def test_its_ends_are_held_and_so_is_the_end_of_the_margin() -> None:
    wide = RANGE.widened()
    assert RANGE.holds(np.array([RANGE.lower, RANGE.upper, wide.lower, wide.upper])).all()
    for place in range(2):  # one value beyond the margin suffices
        beyond = np.array([wide.lower, wide.upper])
        beyond[:, place] = np.nextafter(beyond[:, place], [-1.0, 1.0])
        assert not RANGE.holds(beyond).any()


def test_where_a_load_is_not_known_is_outside() -> None:
    load = PositionLoad(0.05, 0.15, np.zeros(2), np.ones(2))
    trusted, wide = RANGE.trusted(load), RANGE.widened()
    assert (trusted.lower, trusted.upper) == ((0.05, wide.lower[1]), (0.15, wide.upper[1]))
    further = PositionLoad(-1.0, 1.0, np.zeros(2), np.ones(2))
    assert RANGE.trusted(further) == RANGE.trusted(None) == wide
