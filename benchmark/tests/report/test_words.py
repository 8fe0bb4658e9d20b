"""Numbers and identifiers as readers see them."""

from __future__ import annotations

import math

import pytest

from friction_benchmark.report.words import of_size, plain, signed


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
