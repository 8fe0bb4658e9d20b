"""What the benchmark's page is made of: scales, shades, names beside marks, the Pareto front, numbers as words."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from friction_benchmark.report.costs import pareto_front
from friction_benchmark.report.drawing import Drawing, Scale, logarithmic
from friction_benchmark.report.grid import shade
from friction_benchmark.report.labels import Labels
from friction_benchmark.report.words import of_size, plain, signed
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


@given(st.floats(-2.0, 2.0))
def test_letters_stay_legible_on_every_shade(strength: float) -> None:
    def light(colour: str) -> float:
        parts = [int(colour[index : index + 2], 16) / 255.0 for index in (1, 3, 5)]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    lights = sorted((light(colour) for colour in shade(strength)), reverse=True)
    assert (lights[0] + 0.05) / (lights[1] + 0.05) >= 4.5


@given(st.floats(1e-2, 1e4), st.floats(3.0, 1e6))
def test_a_logarithmic_scale_has_ticks_inside_and_keeps_the_order(low: float, ratio: float) -> None:
    scale = logarithmic([low, low * ratio], 10.0, 200.0)
    ticks = scale.ticks()
    assert 1 <= len(ticks) <= 12
    assert all(scale.low <= tick <= scale.high for tick in ticks)
    places = [scale(tick) for tick in ticks]
    assert places == sorted(places)
    assert 10.0 < scale(low) < scale(low * ratio) < 200.0


@given(st.floats(0.0, 0.9), st.floats(0.02, 1.0))
def test_a_linear_scale_has_a_few_round_ticks(low: float, span: float) -> None:
    scale = Scale(low, low + span, 0.0, 100.0)
    assert 2 <= len(scale.ticks(8)) <= 8
    assert scale(low - 1.0) == 0.0
    assert scale(low + span + 1.0) == 100.0


def test_names_keep_clear_of_marks_lines_and_each_other() -> None:
    drawing = Drawing(300.0, "crowd")
    labels = Labels(drawing, (0.0, 0.0, 560.0, 300.0))
    places = [(100.0 + 9.0 * n, 150.0 + 3.0 * n) for n in range(10)]
    for place in places:
        labels.keep_clear(place, 6.0)
    written = [labels.add(place, "a rather long name", strong=True) for place in places]
    boxes = labels.taken
    assert sum(written) == len(boxes) - len(places) >= 5
    named = boxes[len(places) :]
    assert not any(one.meets(other) for one in named for other in boxes if other is not one)
    assert not Labels(drawing, (0.0, 0.0, 40.0, 20.0)).add((20.0, 10.0), "no room for this", strong=True)


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.0, "0.00"), (4.556, "4.56"), (9.996, "10.0"), (45.55, "45.5"), (456.4, "456"), (17408.0, "17,408")],
)
def test_numbers_have_about_three_digits(value: float, words: str) -> None:
    assert of_size(value) == words
    assert of_size(-value) == (f"−{words}" if value else words)
    assert signed(value) == (f"+{words}" if value else words)
    assert signed(-0.001) == signed(0.001) == "0.00"
    assert of_size(math.nan) == of_size(math.inf) == "–"


def test_identifiers_become_words() -> None:
    assert plain("forecast_100ms") == "forecast 100 ms"
    assert plain("pressure_free") == "pressure free"
    assert plain("alarms") == "alarms"
