"""The pages of a fleet's health: what needs a person comes first, and a cylinder's life is drawn once it is chosen."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Page

import packed_pages
from cylinder_friction_monitoring.errors import Refused
from cylinder_friction_monitoring.fleet.files import pane_file
from cylinder_friction_monitoring.page.health_page import health_pane, write_health_page
from cylinder_friction_monitoring.trends.assessment import Assessment, Baseline, Change, Entry, IndicatorTrend
from cylinder_friction_monitoring.trends.cylinder_line import CylinderLine, in_order, line_of
from cylinder_friction_monitoring.trends.sentences import rate
from cylinder_friction_monitoring.trends.session_row import SessionRow
from cylinder_friction_monitoring.trends.verdict import assess
from fleet_samples import session
from health_rows import changed, sessions

SESSIONS = 60


def found_of(name: str, rows: Sequence[SessionRow], answer: str, since: int | None = None) -> Assessment:
    """Return a cylinder's assessment; with ``since`` its friction falls from that session on."""
    names = tuple(row.session for row in rows)
    values = tuple(row.indicators["friction_n"].value for row in rows)
    nothing = (None,) * len(rows)
    base = Baseline(30, 30, names[0], names[29], 400.0, 5.0, 0.4, 12.0, 0.02, 20.0) if len(rows) > 30 else None
    trend = IndicatorTrend(base, names, values, nothing, nothing, "" if base else "too few")
    changes: tuple[Change, ...] = ()
    if since is not None:
        begun, alarm = names[since], names[since + 5]
        changes = (Change("friction_n", -60.0, (-70.0, -50.0), -15.0, (-17.0, -13.0), begun, (begun, alarm), alarm),)
    words = f"The words of {name} <&>."
    return Assessment(name, answer, words, changes, {"friction_n": trend})  # type: ignore[arg-type]


def made(folder: Path, count: int = 4, sessions: int = SESSIONS) -> tuple[CylinderLine, ...]:
    """Write the pages of a fleet whose second cylinder has an alarm, and return its lines."""
    lines = []
    for number in range(count):
        name, worn = f"press {number} ü#", number == 1
        rows = [
            session(day, name, friction_n=340.0 if worn and day > 40 else 400.0 + day % 3) for day in range(sessions)
        ]
        answer = "alarm" if worn else "undecided" if number == 2 else "fine"
        found = found_of(name, rows, answer, 41 if worn else None)
        entries = [Entry(name, "2026-02-01T00:00:00Z", "Kim", "service", "oil changed")]
        lines.append(line_of(found, rows, {}, "state"))
        (folder / "panes").mkdir(exist_ok=True, parents=True)
        (folder / pane_file(name)).write_text(health_pane(found, rows, entries, {}), encoding="utf-8")
    ordered = in_order(lines)
    write_health_page(folder / "health.html", ordered, [Refused("x.csv", "of nobody")], ["press 1 ü#: alarm"])
    return ordered


def test_what_needs_a_person_comes_first(tmp_path: Path) -> None:
    lines = made(tmp_path)
    assert [each.answer for each in lines] == ["alarm", "undecided", "fine", "fine"]
    assert lines[0].headline == "friction -15 % since 2026-02-11"
    page = (tmp_path / "health.html").read_text()
    places = [page.index(words) for words in ("friction -15 % since", "The words of press 2", "The words of press 0")]
    assert places == sorted(places)
    assert "The words of press 1 ü# &lt;&amp;&gt;." in page
    assert "x.csv" in page and "of nobody" in page  # noqa: PT018
    first = page
    made(tmp_path)
    assert (tmp_path / "health.html").read_text() == first, "equal input makes equal bytes"


def test_every_cylinder_and_what_the_fleet_file_states_of_it_are_one_click_away(tmp_path: Path) -> None:
    lines = made(tmp_path)
    write_health_page(tmp_path / "health.html", [replace(each, about="simulated: <wear>") for each in lines], [], [])
    page = (tmp_path / "health.html").read_text()
    assert page.partition('<section id="fleet">')[0].count("#pane=press") == 4, "the healthy ones too"
    assert page.count("<details><summary>About it</summary>simulated: &lt;wear&gt;</details>") == 4
    (tmp_path / "a.js").write_text(health_pane(Assessment("a", "not yet", ""), [], [], {}, "simulated: wear"))
    pane = packed_pages.unpacked_pane(tmp_path / "a.js")
    assert "<summary>About this cylinder</summary><p>simulated: wear</p>" in pane


def test_a_leak_has_one_unit_and_a_rate_no_more_than_was_seen(tmp_path: Path) -> None:
    rows = changed(sessions(230), 130, 60, times={"leak_m3_s_pa": 10.0, "friction_n": 0.8})
    found = assess("press", rows)
    assert "l/min at 100 bar" in found.words
    (tmp_path / "a.js").write_text(health_pane(found, rows, [], {}))
    pane = packed_pages.unpacked_pane(tmp_path / "a.js")
    assert "leak [l/min at 100 bar]" in pane
    assert "0.36" in pane, "ten times 6e-14 m³/(s Pa)"
    assert "m³" not in pane
    assert "e-13" not in pane
    falling = replace(found.changes[0], indicator="friction_n", change=-80.0, per_year=-1061.0)
    assert [rate(replace(falling, change=change))[1] for change in (-90.0, -80.0, -15.0)] == ["month", "week", "day"]
    (tmp_path / "a.js").write_text(health_pane(replace(found, changes=(falling,)), rows, [], {}))
    assert "<dd>-20.3 N a week" in packed_pages.unpacked_pane(tmp_path / "a.js")


def test_an_acknowledged_alarm_and_a_silent_cylinder_find_their_places() -> None:
    rows = [session(day) for day in range(SESSIONS)]
    found = found_of("a", rows, "alarm", 41)
    said = line_of(replace(found, answer="watch", acknowledged="Kim, 2026-03-01"), rows, {}, "")
    assert (line_of(found, rows, {}, "").rank, said.rank) == (0, 4)
    assert said.acknowledged == "Kim, 2026-03-01"
    quiet = line_of(found_of("b", rows[:20], "fine"), rows[:20], {}, "")
    silent = in_order([quiet, said])[0]
    assert (silent.cylinder, silent.look) == ("b", "no session since 2026-01-20")
    left_out = {row.session: "another cylinder" for row in rows[-3:]}
    doubtful = line_of(found_of("a", rows[:-3], "fine"), rows, left_out, "")
    assert (doubtful.look, doubtful.left_out) == ("its last 3 sessions are not assessed", 3)


def test_a_cylinder_shows_its_life_and_its_strokes(tmp_path: Path) -> None:
    made(tmp_path)
    pane = packed_pages.unpacked_pane(tmp_path / pane_file("press 1 ü#"))
    for words in (
        "Then and now",
        "oil changed",
        "2026-02-11",
        "-15 % (-17 to -13)",
        "MAINTENANCE_REQUIRED",
        "alarm at",
    ):
        assert words in pane
    short = health_pane(found_of("a", [session(0)], "not yet"), [session(0, stroke=None)], [], {"a-0009": "of b"})
    (tmp_path / "a.js").write_text(short)
    assert "of b" in packed_pages.unpacked_pane(tmp_path / "a.js")
    nothing = health_pane(Assessment("a", "not yet", "no session yet"), [], [], {})
    assert "pane(" in nothing


def test_the_page_of_a_large_fleet_is_small(tmp_path: Path) -> None:
    rows = [session(day, friction_n=400.0 + day % 7) for day in range(365)]
    line = line_of(found_of("a", rows, "fine"), rows, {}, "")
    write_health_page(tmp_path / "health.html", [line] * 200, [], [])
    assert (tmp_path / "health.html").stat().st_size < 3e6


@pytest.mark.extended
@pytest.mark.parametrize("width", [1400, 400])
def test_a_cylinder_is_found_drawn_and_left_by_keyboard(
    tmp_path: Path, new_page: Callable[..., Page], width: int
) -> None:
    made(tmp_path, 14)
    page, errors = new_page(width, 900), list[str]()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((tmp_path / "health.html").as_uri())
    rows = page.locator("#fleet tbody tr:visible")
    assert rows.count() == 14
    assert rows.first.inner_text().startswith("press 1 ü#")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.locator(".counts button", has_text="undecided").click()
    assert rows.count() == 1
    page.locator(".counts button", has_text="undecided").click()
    page.keyboard.press("/")
    page.keyboard.type("press 12")
    assert page.locator("#left").inner_text() == "1 of 14"
    page.locator("#finder").fill("")
    page.locator("#finder").blur()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    page.locator("#pane .plot .main-svg").first.wait_for()
    assert page.locator("#pane h1").inner_text().startswith("press 1 ü#")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.keyboard.press("Escape")
    page.locator("#fleet").wait_for()
    assert errors == []
