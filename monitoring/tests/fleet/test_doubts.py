"""Sessions of a wrong clock or a foreign log are named; machines that stood still are not."""

from datetime import UTC, datetime

from cylinder_friction_monitoring.fleet.doubts import doubts, too_late
from cylinder_friction_monitoring.trends.assessment import Entry
from fleet_samples import session

NOW = datetime(2026, 3, 1, tzinfo=UTC)
ROWS = [session(number) for number in range(40)]


def test_sessions_in_order_and_a_machine_that_stood_still_are_without_doubt() -> None:
    assert doubts(ROWS, [], NOW) == {}
    first = session(0, start="2025-11-01T06:00:00Z")
    last = session(41, start="2026-02-28T06:00:00Z")
    assert doubts([first, *ROWS[1:3], *ROWS[10:], last], [], NOW) == {}


def test_a_clock_in_the_future_and_a_missing_start_are_named() -> None:
    ahead = session(20, start="2027-01-21T06:00:00Z")
    found = doubts([*ROWS[:20], ahead, *ROWS[21:]], [], NOW)
    assert found == {
        "a-0020": "begins in the future, at 2027-01-21T06:00:00Z: its clock is off; state the right one in fleet.yaml, "
        "starts: {a-0020: ...}",
    }
    assert list(doubts([*ROWS[:20], session(20, start=""), *ROWS[21:]], [], NOW)) == ["a-0020"]


def test_a_session_is_compared_with_its_own_place_or_with_the_newest_assessed_one() -> None:
    newest, before = ROWS[-1].start, {row.session: row.start for row in ROWS[:-5]}
    assert too_late(ROWS, before, "", 3.0) == {}, "the first night"
    assert list(too_late(ROWS, before, newest, 3.0)) == ["a-0035"], "new ones: a-0035 to a-0039"
    assert too_late(ROWS, before, newest, 4.0) == {}
    assert too_late(ROWS, {}, newest, "accept") == {}
    moved = session(10, start="2025-01-11T06:00:00Z")
    assert list(too_late([moved], before, newest, 3.0)) == ["a-0010"], "a log of the same name"
    ahead = {"a-0039": "2027-01-01T06:00:00Z"}
    assert too_late(ROWS[-1:], ahead, newest, 3.0) == {}, "it was in the future, and is corrected"


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
