"""Fewer points than samples: nothing that the eye would see is lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.reporting.page import Line, Panel, compact, extremes, over_time


@given(st.lists(st.floats(-1e6, 1e6), max_size=400), st.integers(2, 60))
def test_extremes_keep_the_peaks_and_the_bound_and_last_as_long(values: list[float], points: int) -> None:
    array = np.array(values)
    kept, samples = extremes(array, points)
    assert len(kept) <= points
    assert len(array) <= len(kept) * samples < len(array) + 2.0 * samples
    if len(array):
        assert kept.max() == array.max()
        assert kept.min() == array.min()


def test_a_gap_stays_a_gap() -> None:
    values = np.sin(np.arange(1000.0))
    values[400:600] = np.nan
    kept, _ = extremes(values, 100)
    assert np.isnan(kept[40:60]).all()
    assert np.isfinite(kept[:40]).all()


@given(st.lists(st.floats(-1e9, 1e9), max_size=50), st.floats(1e-6, 1e6))
def test_compact_values_are_exact_to_a_thousandth_of_their_span(values: list[float], scale: float) -> None:
    array = scale * np.array(values)
    error = np.abs(compact(array).astype(float) - array)
    assert (error <= 0.5e-3 * np.ptp(array) + 1e-6 + 1e-12 * np.abs(array)).all() if len(array) else not len(error)


def test_lines_over_time_begin_and_end_where_the_signal_does() -> None:
    time_s = 5.0 + 0.01 * np.arange(1000)
    figure = over_time(time_s, [Panel("x", [Line("a", np.sin(time_s), "#000"), Line("b", time_s, "#000")])], points=100)
    for line in figure.data:
        assert line["x0"] == 5.0
        assert line["x0"] + line["dx"] * len(line["y"]) == pytest.approx(15.0)
