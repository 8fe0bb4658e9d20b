"""Lagged and averaged features against what they are by definition."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from friction_benchmark.models.lagged import Past

ROWS = np.random.default_rng(1).normal(size=(60, 2)).astype(np.float32)


def test_lags_are_earlier_rows_and_the_first_row_before_the_first() -> None:
    past = Past(lags=(1, 5))
    found = past.advance(past.new_memory(), ROWS)
    assert found.shape == (60, past.width(2)) == (60, 6)
    np.testing.assert_array_equal(found[:, :2], ROWS)
    np.testing.assert_array_equal(found[1:, 2:4], ROWS[:-1])
    np.testing.assert_array_equal(found[5:, 4:], ROWS[:-5])
    np.testing.assert_array_equal(found[:5, 4:], np.repeat(ROWS[:1], 5, axis=0))


def test_averages_settle_on_a_constant_with_their_time_constant() -> None:
    past = Past(averages=(20.0,))
    found = past.advance(past.new_memory(), np.ones((200, 1), dtype=np.float32))
    assert found[19, 1] == pytest.approx(1.0 - np.exp(-1.0), abs=0.02)
    assert found[-1, 1] == pytest.approx(1.0, abs=1e-3)


@given(cut=st.integers(0, 60), other=st.integers(0, 60))
def test_cutting_the_rows_changes_no_bit(cut: int, other: int) -> None:
    past = Past(lags=(3, 17), averages=(5.0, 50.0))
    whole = past.advance(past.new_memory(), ROWS)
    memory = past.new_memory()
    first, second = sorted((cut, other))
    pieces = [past.advance(memory, piece) for piece in (ROWS[:first], ROWS[first:second], ROWS[second:])]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_round_trip_and_refusals() -> None:
    past = Past((2, 4), (10.0,))
    assert Past(**json.loads(json.dumps(asdict(past)))) == past
    for wrong in ({"lags": (0,)}, {"averages": (0.5,)}):
        with pytest.raises(ValueError, match="expected lags and averages of at least 1 sample, but got"):
            Past(**wrong)
