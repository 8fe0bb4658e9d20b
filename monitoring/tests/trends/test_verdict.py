"""One of five answers, and the sentence that a maintenance engineer needs."""

import json
from dataclasses import replace
from datetime import UTC, datetime
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


def test_healthy_cylinder_is_fine_and_states_what_it_could_not_see() -> None:
    found = assess("press", sessions(200))
    assert found.answer == "fine"
    assert found.words == "No change of friction in 110 sessions; lasting changes below 2 % cannot be found."
    assert found.to_dict()["ne107"] == "NORMAL"
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize("count", [0, 1, 40, 89])
def test_short_baseline_is_not_yet(count: int) -> None:
    found = assess("press", sessions(count))
    assert (found.answer, found.more_sessions) == ("not yet", 90 - count)
    assert f"{90 - count} more are needed before an alarm can be believed" in found.words


def without_oil(rows: list[SessionRow]) -> list[SessionRow]:
    return [replace(row, covariates={**row.covariates, "oil_temperature_c": None}) for row in rows]


LOAD, ZERO, SMALL_LEAK = {"half_sum_n": 600.0}, {"half_sum_n": 312.0}, {"leak_m3_s_pa": 2.5}
FAR = {"pressure_1_bar": 60.0, "pressure_2_bar": 60.0}
COLD, STIFFER = {"oil_temperature_c": -6.0}, {"friction_n": 1.018, "breakaway_n": 1.018}
WORSE, LOADED = changed(sessions(250), 130, times=FRICTION), changed(sessions(250), 130, add=LOAD)
SITUATIONS: dict[str, tuple[list[SessionRow], str, str]] = {
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
    assert words in " ".join((found.words, *found.would_decide, *found.questions))


def test_session_that_determines_nothing_does_not_count() -> None:
    rows = sessions(95)
    nothing = {name: replace(each, value=None, why="no stroke back") for name, each in rows[0].indicators.items()}
    found = assess("press", [replace(row, indicators=nothing) for row in rows])
    assert (found.answer, found.words[:16], "no stroke back" in found.words) == ("not yet", "0 of 90 sessions", True)


@pytest.mark.parametrize(("times", "verb"), [(FRICTION, "rose"), (WORN, "fell")])
def test_friction_that_changes_either_way_alarms(times: dict[str, float], verb: str) -> None:
    found = assess("press", changed(sessions(200), 150, times=times))
    assert found.answer == "alarm"
    assert found.words.startswith(f"Friction {verb} by ")
    assert "since session s150" in found.words
    (change, *_) = found.changes
    expected = times["friction_n"] * 400.0 - 400.0
    assert change.interval[0] < expected < change.interval[1]
    assert change.percent == pytest.approx(expected / 4.0, abs=3.0)
    assert change.since == "s150"
    assert len(found.questions) == 1


def test_wear_on_its_way_names_the_date_of_the_limit() -> None:
    rows = changed(sessions(230), 130, 150, times=FRICTION | {"friction_n": 1.3})
    found = assess("press", rows, plan=MonitorPlan(limit_percent={"friction_n": 30.0}))
    change = found.changes[0]
    assert found.answer == "alarm"
    assert change.limit_reached is not None
    assert change.limit_interval is not None
    assert str(change.limit_interval[0]) < change.limit_reached < str(change.limit_interval[1])
    assert "2025-09-15" < change.limit_reached < "2025-11-15"
    assert change.per_year_interval is not None
    assert change.per_year_interval[0] < 0.3 * 400.0 / 150.0 * 365.25 < change.per_year_interval[1]
    assert abs(int(change.since[1:]) - 130) <= 15


def test_a_limit_that_is_passed_names_since_when() -> None:
    rows = changed(sessions(330), 130, 100, times=FRICTION | {"friction_n": 1.4})
    found = assess("press", rows, plan=MonitorPlan(limit_percent={"friction_n": 20.0}))
    change = found.changes[0]
    assert change.limit_passed
    assert "and has passed your limit since about 2025-06" in found.words or "since about 2025-07" in found.words
    assert change.limit_interval is not None
    assert str(change.limit_interval[0]) <= str(rows[180].start[:10]) <= str(change.limit_interval[1])


@pytest.mark.parametrize("begins", [130, 145])
def test_other_oil_is_asked_for(begins: int) -> None:
    rows = changed(sessions(200), begins, times=FRICTION)
    viscous = [
        replace(row, indicators={**row.indicators, "viscous_n_s_m": replace(row.indicators["profile_n"], value=value)})
        for row, value in zip(
            rows, (1500.0 + 30.0 * (day % 7) + 900.0 * (day >= 130) for day in range(200)), strict=True
        )
    ]
    found = assess("press", viscous)
    assert found.answer == "undecided"
    assert any("oil was changed" in each for each in found.would_decide)


def test_new_seal_that_nobody_entered_is_for_the_better() -> None:
    rows = changed(
        changed(sessions(260), 120, 60, times=WORN | {"leak_m3_s_pa": 5.0}),
        200,
        times={"friction_n": 1.26, "breakaway_n": 1.26, "leak_m3_s_pa": 0.2},
    )
    found = assess("press", rows)
    assert found.answer == "watch"
    assert "changed for the better at session s200" in found.words
    assert "seal" in found.questions[0]


def test_worn_seal_that_also_runs_more_evenly_is_still_worn() -> None:
    found = assess("press", changed(changed(sessions(250), 130, times=WORN), 170, times={"profile_n": 0.5}))
    assert found.answer == "alarm"
    assert found.words.startswith("Friction fell by ")
    assert "profile_n" in [change.indicator for change in found.changes]


@pytest.mark.parametrize("kind", ["service", "reset", "reference"])
def test_service_begins_a_new_baseline(kind: str) -> None:
    rows = changed(sessions(260), 150, times=WORN)
    assert assess("press", rows).answer == "alarm"
    found = assess("press", rows, [entry(kind, "2025-05-31T06:00:00Z")])
    baseline = found.trends["friction_n"].baseline
    assert found.answer == "fine"
    assert baseline is not None
    assert baseline.first == "s150"


@pytest.mark.parametrize("kind", ["service", "reset", "reference"])
@pytest.mark.parametrize("time", ["2030-01-01", "2025-10-01"])
def test_a_baseline_that_has_not_come_hides_no_alarm(kind: str, time: str) -> None:
    rows, now = changed(sessions(200), 150, times=WORN), datetime(2025, 11, 1, tzinfo=UTC)
    found = assess("press", rows, [entry(kind, time)], now=now)
    assert found.answer == "alarm"
    assert found.words == assess("press", rows).words
    reason = "has not come" if time == "2030-01-01" else "is 73 days after the newest session"
    assert f"is the date right? the {kind} of {time} (entered by Kim) {reason}" in found.questions[-1]


def acknowledged(rows: list[SessionRow], time: str = "2025-07-01", **plan: Any) -> Assessment:
    return assess("press", rows, [entry("acknowledge", time)], MonitorPlan(**plan), datetime(2025, 9, 1, tzinfo=UTC))


def test_acknowledged_alarm_is_watched() -> None:
    rows = changed(sessions(200), 150, times=WORN)
    found = acknowledged(rows)
    assert found.answer == "watch"
    assert found.words.endswith("Acknowledged by Kim on 2025-07-01.")
    assert found.acknowledged == "Kim, 2025-07-01"
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


def test_one_session_alone_alarms_nobody() -> None:
    rows = sessions(200)
    rows[150] = changed([rows[150]], 0, times={"friction_n": 3.0, "leak_m3_s_pa": 100.0})[0]
    assert assess("press", rows).answer in ("fine", "watch")


def test_rows_in_any_order_and_of_other_cylinders() -> None:
    rows = changed(sessions(200), 150, times=WORN)
    others = [replace(row, cylinder="other") for row in rows]
    assert assess("press", [*others, *rows[::-1]]) == assess("press", rows)


def test_sessions_that_all_say_the_same_give_no_baseline() -> None:
    found = assess("press", [replace(row, indicators=sessions(1)[0].indicators) for row in sessions(120)])
    assert (found.answer, "same value" in found.trends["friction_n"].why) == ("not yet", True)
