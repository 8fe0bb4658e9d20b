"""Sessions of a wrong clock or a foreign log are named; late logs and machines that stood still are not."""

from datetime import UTC, datetime

from cylinder_friction_monitoring.fleet.doubts import doubts
from cylinder_friction_monitoring.trends.assessment import Entry
from fleet_samples import session

NOW = datetime(2026, 3, 1, tzinfo=UTC)
ROWS = [session(number) for number in range(40)]


def test_sessions_in_order_a_late_log_and_a_machine_that_stood_still_are_without_doubt() -> None:
    assert doubts(ROWS, [], NOW) == {}
    assert doubts([*ROWS[:10], *ROWS[11:], ROWS[10]], [], NOW) == {}
    first = session(0, start="2025-11-01T06:00:00Z")
    last = session(41, start="2026-02-28T06:00:00Z")
    assert doubts([first, *ROWS[1:3], *ROWS[10:], last], [], NOW) == {}


def test_a_clock_in_the_future_or_a_year_off_is_named() -> None:
    ahead, behind = session(20, start="2027-01-21T06:00:00Z"), session(21, start="2025-01-22T06:00:00Z")
    found = doubts([*ROWS[:20], ahead, behind, *ROWS[22:]], [], NOW)
    assert found == {
        "a-0020": "begins in the future, at 2027-01-21T06:00:00Z: its clock is off; state the right one in fleet.yaml, "
        "starts: {a-0020: ...}",
        "a-0021": "begins at 2025-01-22, 366 days before its neighbours by name: its clock is off; state the right one "
        "in fleet.yaml, starts: {a-0021: ...}",
    }
    assert list(doubts([*ROWS[:20], session(20, start=""), *ROWS[21:]], [], NOW)) == ["a-0020"]
    first = [session(0, start="2025-01-01T06:00:00Z"), *ROWS[1:]]
    assert list(doubts(first, [], NOW)) == ["a-0000"], "the first session, a year before all others"


def test_a_log_of_another_cylinder_is_named_until_a_person_resets() -> None:
    other = session(20, half_sum_n=5000.0)
    reversed_ = session(21, friction_n=-380.0)
    found = doubts([*ROWS[:20], other, reversed_, *ROWS[22:]], [], NOW)
    assert list(found) == ["a-0020", "a-0021"]
    assert found["a-0020"].startswith(
        "half the sum of its strokes is 5000 N, while 20 sessions before it have 20 ± 0 N: a log of another cylinder"
    )
    assert "its friction is -380 N, less than none" in found["a-0021"]
    loaded = [*ROWS[:20], *(session(number, half_sum_n=5000.0) for number in range(20, 40))]
    assert len(doubts(loaded, [], NOW)) == 20
    reset = Entry("a", "2026-01-21T00:00:00Z", "Kim", "reset", "a heavier tool")
    assert doubts(loaded, [reset], NOW) == {}
