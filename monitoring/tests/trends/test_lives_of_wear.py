"""Wear within a baseline is named, and a rate is that of the last sessions, over lives that nobody chose."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction_monitoring.trends.assessment import Assessment
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.session_row import Indicator, SessionRow
from cylinder_friction_monitoring.trends.verdict import assess
from health_rows import changed, sessions

LIVES, BASELINE, BEGINS = 30, 90, 120
LEVEL_N = 400.0


def worn(seed: int, count: int, first: int, within: int, size: float) -> list[SessionRow]:
    """Return sessions whose friction changes by the share ``size`` within some sessions, then stays."""
    times = {"friction_n": 1.0 + size, "breakaway_n": 1.0 + size}
    return correlated(changed(sessions(count, seed), first, within, times=times), seed)


def correlated(rows: list[SessionRow], seed: int) -> list[SessionRow]:
    """Add scatter of 2 % that neighbouring sessions share, as days of one week do."""
    generator = np.random.default_rng([seed, 1])
    share = 0.0
    found = []
    for row in rows:
        share = 0.5 * share + 0.02 * np.sqrt(0.75) * float(generator.normal())
        factors = {"friction_n": 1.0 + share, "breakaway_n": 1.0 + share}
        found += changed([row], 0, times=factors)
    return found


def rate_holds(found: Assessment, true_n_a_year: float) -> bool:
    """Check the interval of the rate of friction, and that words state a rate only if it is not 0."""
    change = next(each for each in found.changes if each.indicator == "friction_n")
    assert change.per_year_interval is not None
    low, high = change.per_year_interval
    if found.changes[0] is change and found.answer == "alarm":
        assert bool(re.search("now (rising|falling)", found.words)) == (low * high > 0.0)
    return low <= true_n_a_year <= high


def test_wear_within_the_baseline_is_named_and_the_baseline_not_used() -> None:
    named = 0
    for seed in range(LIVES):
        generator = np.random.default_rng(seed)
        first = int(generator.integers(5, 60))
        within = int(generator.integers(1, BASELINE - first))
        size = float(generator.choice([-1.0, 1.0]) * generator.uniform(0.2, 0.4))
        found = assess("press", worn(seed, 150, first, within, size))
        verb = "rose" if size > 0.0 else "fell"
        words = f"{verb} by .* within its baseline, sessions s000 to s089, which is therefore not used"
        if re.search(f"Friction {words}", " ".join((found.words, *found.questions))):
            assert found.answer in ("undecided", "alarm")
            assert found.trends["friction_n"].baseline is None
            assert "not used" in found.trends["friction_n"].why
            named += 1
    assert named >= 0.95 * LIVES


def test_a_steady_baseline_is_used() -> None:
    moved = sum(
        found.trends["friction_n"].baseline is None
        for found in (assess("press", correlated(sessions(100, seed), seed)) for seed in range(100))
    )
    assert moved <= 1


@pytest.mark.parametrize(
    "last",
    [pytest.param(lambda generator: int(generator.integers(7, 40)), id="stopped"), lambda generator: 0],
)
def test_a_rate_is_that_of_the_last_sessions(last: Callable[[np.random.Generator], int]) -> None:
    missed = []
    for seed in range(LIVES):
        generator = np.random.default_rng([seed, 2])
        within = int(generator.integers(20, 120))
        size = float(generator.choice([-1.0, 1.0]) * generator.uniform(0.2, 0.4))
        at_rest = last(generator)
        rows = worn(seed, BEGINS + within + at_rest, BEGINS, within, size)
        true_n_a_year = 0.0 if at_rest else size / within * LEVEL_N * 365.25
        found = assess("press", rows, plan=MonitorPlan(baseline_sessions=BASELINE))
        missed.append(not rate_holds(found, true_n_a_year))
    assert np.mean(missed) <= 0.1


def test_a_rate_counts_days_and_not_sessions() -> None:
    rows = worn(3, 250, 130, 120, 0.4)
    weekly = [row for day, row in enumerate(rows) if day < 130 or day % 3 == 0]
    found = assess("press", weekly)
    assert rate_holds(found, 0.4 / 120.0 * LEVEL_N * 365.25)


@pytest.mark.parametrize(("at_rest", "stated"), [(4, True), (5, False), (25, False)])
def test_no_rate_is_stated_once_the_cylinder_stands_still(at_rest: int, stated: bool) -> None:
    rows = worn(4, BEGINS + 60, BEGINS, 60, 0.4)
    nothing = dict.fromkeys(rows[0].indicators, Indicator(None, why="no stroke"))
    still = [replace(row, indicators=nothing) for row in sessions(len(rows) + at_rest)[len(rows) :]]
    found = assess("press", rows + still, plan=MonitorPlan(limit_percent={"friction_n": 50.0}))
    assert found.answer == "alarm"
    assert ("now rising" in found.words, "reaches your limit" in found.words) == (stated, stated)


def test_little_scatter_does_not_promise_to_find_everything() -> None:
    rows = sessions(120, 5)
    level = rows[0].indicators["friction_n"]
    assert level.value is not None
    steady = [
        changed([row], 0, times={"friction_n": level.value / (row.indicators["friction_n"].value or 1.0)})[0]
        for row in rows
    ]
    shaken = [changed([row], 0, add={"friction_n": 0.01 * (day % 7)})[0] for day, row in enumerate(steady)]
    assert "lasting changes below 1 % cannot be found" in assess("press", shaken).words
