"""One of five answers, and the sentence that a maintenance engineer needs."""

import json
import re
from dataclasses import replace
from datetime import UTC, date, datetime
from typing import Any

import pytest

from cylinder_friction_monitoring.trends.assessment import Assessment, Entry
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.session_row import SessionRow
from cylinder_friction_monitoring.trends.verdict import assess
from health_rows import changed, sessions

FRICTION = {"friction_n": 1.15, "breakaway_n": 1.15}
WORN = {"friction_n": 0.8, "breakaway_n": 0.8}


def entry(kind: str, time: str) -> Entry:
    return Entry("press", time, "Kim", kind)  # type: ignore[arg-type]


def without_oil(rows: list[SessionRow]) -> list[SessionRow]:
    return [replace(row, covariates={**row.covariates, "oil_temperature_c": None}) for row in rows]


LOAD, ZERO, SMALL_LEAK = {"half_sum_n": 600.0}, {"half_sum_n": 312.0}, {"leak_m3_s_pa": 2.5}
FAR = {"pressure_1_bar": 60.0, "pressure_2_bar": 60.0}
COLD, STIFFER = {"oil_temperature_c": -6.0}, {"friction_n": 1.018, "breakaway_n": 1.018}
WORSE, LOADED = changed(sessions(250), 130, times=FRICTION), changed(sessions(250), 130, add=LOAD)
NOTHING = {name: replace(each, value=None, why="no stroke back") for name, each in sessions(1)[0].indicators.items()}
NEW_SEAL = {"friction_n": 1.26, "breakaway_n": 1.26, "leak_m3_s_pa": 0.2}
BELIEVED = "more are needed before an alarm can be believed"
FINE = "No change of friction in 110 sessions; lasting changes below 2 % cannot be found."


def viscous(begins: int) -> list[SessionRow]:
    """Return sessions whose friction rises at ``begins``, and its viscous slope at session 130."""
    found = []
    for day, row in enumerate(changed(sessions(200), begins, times=FRICTION)):
        slope = replace(row.indicators["profile_n"], value=1500.0 + 30.0 * (day % 7) + 900.0 * (day >= 130))
        found.append(replace(row, indicators={**row.indicators, "viscous_n_s_m": slope}))
    return found


SITUATIONS: dict[str, tuple[list[SessionRow], str, str]] = {
    "a healthy cylinder": (sessions(200), "fine", FINE),
    **{f"{count} sessions": (sessions(count), "not yet", f"{90 - count} {BELIEVED}") for count in (0, 1, 40, 89)},
    "sessions that determine nothing": (
        [replace(row, indicators=NOTHING) for row in sessions(95)],
        "not yet",
        "the latest of the others: no stroke back",
    ),
    "other oil": (viscous(130), "undecided", "oil was changed"),
    "other oil before friction rises": (viscous(145), "undecided", "oil was changed"),
    "a new seal that nobody entered": (
        changed(changed(sessions(260), 120, 60, times=WORN | {"leak_m3_s_pa": 5.0}), 200, times=NEW_SEAL),
        "watch",
        "was the seal changed before session s200?",
    ),
    "a worn seal that also runs more evenly": (
        changed(changed(sessions(250), 130, times=WORN), 170, times={"profile_n": 0.5}),
        "alarm",
        "profile_n",
    ),
    "a zero that drifts": (changed(sessions(250), 120, 100, add=ZERO), "undecided", "vented chambers"),
    "a leak": (changed(sessions(250), 120, 100, times={"leak_m3_s_pa": 10.0}), "alarm", "shut the cylinder off"),
    "a small leak beside a moved zero": (changed(sessions(250), 120, 60, times=SMALL_LEAK, add=ZERO), "undecided", ""),
    "friction beside another load": (changed(sessions(200), 130, times=FRICTION, add=LOAD), "undecided", "load"),
    "friction after another load": (changed(LOADED, 170, times=FRICTION), "undecided", ""),
    "friction before another load": (changed(WORSE, 170, add=LOAD), "alarm", ""),
    "cold oil that the baseline knows": (changed(sessions(200), 120, times=STIFFER, beside=COLD), "fine", ""),
    "oil that nobody measures": (without_oil(WORSE), "undecided", "temperature sensor"),
    "oil that nobody measures any more": (
        sessions(195) + without_oil(sessions(200)[195:]),
        "undecided",
        "is not known",
    ),
    "oil much colder": (changed(sessions(200), 190, beside={"oil_temperature_c": -45.0}), "undecided", "oil temp"),
    "pressures beyond the baseline": (changed(WORSE, 130, beside=FAR), "undecided", "mean pressure is"),
    "sessions without a start": ([replace(row, start="") for row in WORSE], "alarm", ""),
}


@pytest.mark.parametrize("situation", SITUATIONS)
def test_each_situation_has_its_answer(situation: str) -> None:
    rows, answer, words = SITUATIONS[situation]
    found = assess("press", rows)
    assert found.answer == answer
    changes = [change.indicator for change in found.changes]
    assert words in " ".join((found.words, *found.would_decide, *found.questions, *changes))
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize(("times", "verb"), [(FRICTION, "rose"), (WORN, "fell")])
def test_friction_that_changes_either_way_alarms(times: dict[str, float], verb: str) -> None:
    found = assess("press", changed(sessions(200), 150, times=times))
    assert re.match(f"Friction {verb} by .* since session s150", found.words)
    change, expected = found.changes[0], times["friction_n"] * 400.0 - 400.0
    assert change.interval[0] < expected < change.interval[1]
    assert change.percent == pytest.approx(expected / 4.0, abs=3.0)
    assert (found.answer, change.since, len(found.questions)) == ("alarm", "s150", 1)


@pytest.mark.parametrize(
    ("count", "within", "factor", "percent", "reached", "words"),
    [
        (230, 150, 1.3, 30.0, "2025-10-06", "and reaches your limit about 2025-"),
        (330, 100, 1.4, 20.0, "2025-06-30", "and has passed your limit since about 2025-0"),
    ],
)
def test_a_limit_names_when_it_is_reached_or_since_when_it_is_passed(
    count: int, within: int, factor: float, percent: float, reached: str, words: str
) -> None:
    rows = changed(sessions(count), 130, within, times=FRICTION | {"friction_n": factor})
    found = assess("press", rows, plan=MonitorPlan(limit_percent={"friction_n": percent}))
    change = found.changes[0]
    assert (found.answer, change.limit_passed) == ("alarm", "passed" in words)
    assert words in found.words
    assert change.limit_reached is not None
    assert abs((date.fromisoformat(change.limit_reached) - date.fromisoformat(reached)).days) <= 30
    if not change.limit_passed:
        assert change.limit_interval is not None
        assert str(change.limit_interval[0]) <= change.limit_reached <= str(change.limit_interval[1])
        assert change.per_year_interval is not None
        assert change.per_year_interval[0] < 0.3 * 400.0 / 150.0 * 365.25 < change.per_year_interval[1]
        assert abs(int(change.since[1:]) - 130) <= 15


@pytest.mark.parametrize("kind", ["service", "reset", "reference"])
def test_a_new_baseline_begins_and_one_that_has_not_come_hides_no_alarm(kind: str) -> None:
    rows, now = changed(sessions(260), 150, times=WORN), datetime(2025, 11, 1, tzinfo=UTC)
    found = assess("press", rows, [entry(kind, "2025-05-31T06:00:00Z")])
    baseline = found.trends["friction_n"].baseline
    assert (found.answer, baseline and baseline.first) == ("fine", "s150")
    for time, reason in (("2030-01-01", "has not come"), ("2025-10-01", "is 73 days after the newest session")):
        found = assess("press", rows[:200], [entry(kind, time)], now=now)
        assert (found.answer, found.words) == ("alarm", assess("press", rows[:200]).words)
        assert f"is the date right? the {kind} of {time} (entered by Kim) {reason}" in found.questions[-1]


def acknowledged(rows: list[SessionRow], time: str = "2025-07-01", **plan: Any) -> Assessment:
    return assess("press", rows, [entry("acknowledge", time)], MonitorPlan(**plan), datetime(2025, 9, 1, tzinfo=UTC))


def test_acknowledged_alarm_is_watched() -> None:
    rows = changed(sessions(200), 150, times=WORN)
    found = acknowledged(rows)
    assert (found.answer, found.acknowledged) == ("watch", "Kim, 2025-07-01")
    assert found.words.endswith("Acknowledged by Kim on 2025-07-01.")
    assert acknowledged(rows, limit_percent={"friction_n": 24.0}).answer == "watch"
    early = acknowledged(rows, "2025-03-01")
    assert (early.answer, early.acknowledged) == ("alarm", "")


def test_acknowledged_alarm_returns_when_the_limit_is_passed() -> None:
    rows = changed(changed(sessions(230), 130, times={"friction_n": 1.12}), 200, 30, times={"friction_n": 1.085})
    limit, back = {"friction_n": 20.0}, "Acknowledged by Kim on 2025-07-01, and back: the limit of 20 % for friction"
    assert acknowledged(rows[:200], limit_percent=limit).answer == "watch"
    found = acknowledged(rows, limit_percent=limit)
    assert (found.answer, found.acknowledged) == ("alarm", "")
    assert f"{back} may be passed." in found.words
    again = "2025-08-15"
    assert acknowledged(rows, again, limit_percent=limit).answer == "watch", "three sessions after it"
    assert acknowledged(rows, "2025-08-13", limit_percent=limit).answer == "alarm", "five sessions after it"


def test_acknowledged_alarm_returns_when_it_has_grown_by_half() -> None:
    rows = changed(changed(sessions(240), 130, times={"friction_n": 1.12}), 190, 50, times={"friction_n": 1.87})
    answers = [acknowledged(rows[:count]).answer for count in range(182, 241)]
    assert answers[:10] == ["watch"] * 10
    assert answers[16:] == ["alarm"] * (len(answers) - 16), "18 % are reached at session 193"
    assert "friction had changed by 4" in acknowledged(rows).words


def test_acknowledged_alarm_returns_after_a_time() -> None:
    rows = changed(sessions(200), 150, times=WORN)
    assert [acknowledged(rows, acknowledged_days=each).answer for each in (63.0, 62.0)] == ["watch", "alarm"]
    seen = replace(entry("acknowledge", "2025-07-01"), until="2025-08-31T00:00:00.000Z")
    found = assess("press", rows, [seen], MonitorPlan(acknowledged_days=63.0), datetime(2025, 9, 1, tzinfo=UTC))
    assert found.words.endswith("Acknowledged by Kim on 2025-07-01, and back: its time is over since 2025-08-31.")


@pytest.mark.parametrize("power", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_date_of_accelerating_wear_lies_in_its_interval(power: float, seed: int) -> None:
    rows = sessions(300, seed)
    grown = [
        changed([row], 0, times={"friction_n": 1.0 + 1.1 * (max(day - 149, 0) / 150.0) ** power})[0]
        for day, row in enumerate(rows)
    ]
    first, last = (int(each[1:]) for each in assess("press", grown).changes[0].since_interval)
    assert first <= 150 <= last


def test_one_session_alone_the_order_of_rows_and_other_cylinders_change_nothing() -> None:
    rows = sessions(200)
    rows[150] = changed([rows[150]], 0, times={"friction_n": 3.0, "leak_m3_s_pa": 100.0})[0]
    assert assess("press", rows).answer in ("fine", "watch")
    rows = changed(sessions(200), 150, times=WORN)
    others = [replace(row, cylinder="other") for row in rows]
    assert assess("press", [*others, *rows[::-1]]) == assess("press", rows)
    found = assess("press", [replace(row, indicators=sessions(1)[0].indicators) for row in sessions(120)])
    assert (found.answer, "same value" in found.trends["friction_n"].why) == ("not yet", True)
