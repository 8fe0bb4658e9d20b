"""Charts: the Pareto front, and ticks of a logarithmic axis."""

from __future__ import annotations

import math
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from friction_benchmark.report.charts import _ticks, pareto_front
from friction_benchmark.results import Entry, Interval, Score

ERROR = Interval(1.0, 1.0, 1.0)

entries_drawn = st.lists(st.tuples(st.integers(0, 9), st.integers(1, 9)), min_size=1, max_size=12)


@given(entries_drawn)
def test_the_pareto_front_holds_those_that_nothing_cheaper_beats(costs: list[tuple[int, int]]) -> None:
    entry = Entry("", Score(ERROR, 1.0, 1.0, 1.0, 0.0, 0.0), {}, {}, {}, None, None, None, 0, 1.0, 1.0)
    entries = [
        replace(
            entry, model=str(n), multiply_adds=cost, score=replace(entry.score, percent=Interval(error, error, error))
        )
        for n, (cost, error) in enumerate(costs)
    ]
    front = pareto_front(entries)
    for other in entries:
        beaten = any(
            one.multiply_adds <= other.multiply_adds and one.score.percent.value <= other.score.percent.value
            for one in front
            if one is not other
        )
        assert (other in front) != beaten
    assert [one.multiply_adds for one in front] == sorted(one.multiply_adds for one in front)


@given(st.floats(1e-2, 1e4), st.floats(1.0, 1e6))
def test_a_logarithmic_axis_has_ticks_around_its_values(low: float, ratio: float) -> None:
    ticks = _ticks([low, low * ratio, 0.0, math.nan])["tickvals"]
    assert ticks == sorted(ticks)
    assert ticks[0] <= low * 1.001
    assert ticks[-1] >= low * ratio * 0.999
