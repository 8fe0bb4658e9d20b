from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.labelling.strokes import StrokePoints, stroke_points

STEP_S = 0.01


def strokes(velocity: np.ndarray, usable: np.ndarray | None = None, settling_m: float = 0.0) -> StrokePoints:
    position_m = np.cumsum(velocity) * STEP_S
    usable = np.ones(len(velocity), dtype=np.bool_) if usable is None else usable
    still = 0.0 * velocity
    return stroke_points(10.0 * position_m, position_m, velocity, still, still, usable, STEP_S, 0.01, settling_m)


def test_points_are_means_over_a_tenth_of_a_second() -> None:
    points = strokes(np.full(100, 0.02))
    assert len(points) == 10
    np.testing.assert_allclose(points.position_m[0], 0.02 * STEP_S * np.arange(1, 11).mean())
    np.testing.assert_allclose(points.force_n, 10.0 * points.position_m)
    np.testing.assert_allclose(points.velocity_m_s, 0.02)
    assert points.first_m[0] == pytest.approx(0.0002)
    assert points.last_m[-1] == pytest.approx(0.02)


def test_a_reversal_a_rest_and_an_unusable_row_end_a_stroke() -> None:
    velocity = np.concatenate([np.full(40, 0.02), np.full(40, -0.02), np.zeros(20), np.full(40, -0.02)])
    usable = np.ones(140, dtype=np.bool_)
    usable[120] = False
    points = strokes(velocity, usable)
    assert sorted(np.unique(points.stroke)) == [0, 1, 2, 3]
    assert (np.sign(points.velocity_m_s) == np.where(points.stroke == 0, 1.0, -1.0)).all()


def test_the_first_travel_of_each_stroke_is_left_out() -> None:
    velocity = np.concatenate([np.full(100, 0.02), np.full(100, -0.02)])
    points = strokes(velocity, settling_m=0.01)
    assert points.position_m[points.stroke == 0].min() > 0.01
    assert points.position_m[points.stroke == 1].max() < 0.0105


def test_strokes_of_several_recordings_are_counted_on() -> None:
    one = strokes(np.concatenate([np.full(40, 0.02), np.full(40, -0.02)]))
    joined = StrokePoints.joined([one, strokes(np.zeros(10)), one])
    assert len(joined) == 2 * len(one)
    assert sorted(np.unique(joined.stroke)) == [0, 1, 2, 3]
    assert len(joined.where(joined.stroke == 3)) == len(one.where(one.stroke == 1))


@given(st.lists(st.floats(-0.1, 0.1, allow_nan=False), min_size=1, max_size=300), st.floats(0.0, 0.02))
def test_every_point_is_a_mean_of_rows_that_move_one_way(speeds: list[float], settling_m: float) -> None:
    points = strokes(np.repeat(np.array(speeds), 5), settling_m=settling_m)
    assert (np.abs(points.velocity_m_s) >= 0.01 - 1e-12).all()
    assert all(np.isfinite(values).all() for values in vars(points).values())
    ends = np.stack([points.first_m, points.last_m])
    assert (points.position_m >= ends.min(axis=0) - 1e-9).all()
    assert (points.position_m <= ends.max(axis=0) + 1e-9).all()
    for stroke in np.unique(points.stroke):
        assert len(np.unique(np.sign(points.velocity_m_s[points.stroke == stroke]))) == 1
