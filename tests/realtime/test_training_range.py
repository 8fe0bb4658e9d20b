"""What was taught is in the range, a little more is, and nothing further."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.realtime.guard import TrainingRange
from cylinder_friction.realtime.position_load import PositionLoad

RANGE = TrainingRange(("position_m", "velocity_m_s"), (0.0, -0.1), (0.2, 0.3))


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_row_is_held_where_all_its_values_are_within_the_margin(position_m: float, velocity_m_s: float) -> None:
    wide = RANGE.widened()
    inside = wide.lower[0] <= position_m <= wide.upper[0] and wide.lower[1] <= velocity_m_s <= wide.upper[1]
    assert RANGE.holds(np.array([[position_m, velocity_m_s], [0.1, 0.1]])).tolist() == [inside, True]


def test_its_ends_are_held_and_so_is_the_end_of_the_margin() -> None:
    wide = RANGE.widened()
    assert RANGE.holds(np.array([RANGE.lower, RANGE.upper, wide.lower, wide.upper])).all()
    assert not RANGE.holds(np.nextafter([wide.lower, wide.upper], [[-1.0, -1.0], [1.0, 1.0]])).any()


def test_where_a_load_is_not_known_is_outside() -> None:
    load = PositionLoad(0.05, 0.15, np.zeros(2), np.ones(2))
    trusted, wide = RANGE.trusted(load), RANGE.widened()
    assert (trusted.lower, trusted.upper) == ((0.05, wide.lower[1]), (0.15, wide.upper[1]))
    further = PositionLoad(-1.0, 1.0, np.zeros(2), np.ones(2))
    assert RANGE.trusted(further) == RANGE.trusted(None) == wide
