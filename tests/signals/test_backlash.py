"""The backlash operator: noise in the gap never pushes it, creep does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.signals.backlash import AGE, CENTRE, DIRECTION, new_backlash, push

HALF_WIDTH, STEP_S = 4e-5, 0.005


def pushed_through(positions: np.ndarray, centring: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return whether each position pushed, and the play after the last."""
    play = new_backlash()
    return np.array([push(at, play, HALF_WIDTH, centring, STEP_S) for at in positions], dtype=bool), play


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_creep_pushes_once_it_has_crossed_half_the_gap(way: float) -> None:
    pushed, play = pushed_through(way * 1e-6 * np.arange(100))
    assert np.flatnonzero(pushed).tolist() == list(range(41, 100))
    assert play[CENTRE] == pytest.approx(way * (99e-6 - HALF_WIDTH))
    assert play[DIRECTION] == way
    assert play[AGE] == 0.0


def test_back_in_the_gap_the_push_ages_and_its_direction_stays() -> None:
    pushed, play = pushed_through(np.array([0.0, 1e-3, 1e-3, 0.95e-3]))
    assert pushed.tolist() == [False, True, False, False]
    assert play[DIRECTION] == 1.0
    assert play[AGE] == 2 * STEP_S


@pytest.mark.parametrize(("centring", "expected"), [(0.0, True), (0.01, True), (0.03, False)])
def test_a_play_that_closes_up_loses_creep_below_its_half_width_in_that_time(centring: float, expected: bool) -> None:
    pushed, _ = pushed_through(1e-6 * np.arange(1000), centring)
    assert pushed.any() == expected


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=50), st.floats(0.0, 1.0))
def test_the_position_is_always_in_the_gap_and_the_last_push_tells_the_direction(
    positions: list[float], centring: float
) -> None:
    play, direction = new_backlash(), 0.0
    for at in positions:
        before = play[CENTRE]
        if push(at, play, HALF_WIDTH, centring, STEP_S):
            direction = np.sign(at - before)
        assert abs(at - play[CENTRE]) <= HALF_WIDTH * (1.0 + 1e-9)
        assert play[DIRECTION] == direction
