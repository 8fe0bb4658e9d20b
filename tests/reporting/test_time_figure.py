"""Fewer points than samples: nothing that the eye would see is lost."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.reporting.time_figure import extremes, spread_evenly


@given(st.lists(st.floats(-1e6, 1e6), max_size=400), st.integers(2, 60))
def test_extremes_keep_the_peaks_and_the_order_and_the_bound(values: list[float], points: int) -> None:
    array = np.array(values)
    rows = extremes(array, points)
    assert len(rows) <= max(points, 0) + (points % 2)
    assert (np.diff(rows) > 0).all()
    if len(array):
        assert array[rows].max() == array.max()
        assert array[rows].min() == array.min()


def test_a_gap_stays_a_gap() -> None:
    values = np.sin(np.arange(1000.0))
    values[400:600] = np.nan
    assert np.isnan(values[extremes(values, 100)]).any()


@given(st.integers(0, 500), st.integers(2, 50))
def test_spread_rows_are_some_of_the_rows_with_both_ends(count: int, points: int) -> None:
    rows = np.arange(count) * 3
    kept = spread_evenly(rows, points)
    assert len(kept) == min(count, points)
    assert set(kept) <= set(rows)
    if count:
        assert kept[0] == rows[0]
        assert kept[-1] == rows[-1]
