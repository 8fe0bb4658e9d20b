"""The pages of a fleet's health: what needs a person comes first, and a cylinder's life is drawn once it is chosen."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Page

from cylinder_friction_monitoring.errors import Refused
from cylinder_friction_monitoring.fleet.files import pane_file
from cylinder_friction_monitoring.page.health_page import health_pane, write_health_page
from cylinder_friction_monitoring.trends.assessment import Assessment, Entry
from cylinder_friction_monitoring.trends.cylinder_line import CylinderLine, in_order, line_of
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.sentences import rate
from cylinder_friction_monitoring.trends.session_row import SessionRow
from cylinder_friction_monitoring.trends.verdict import assess
from fleet_samples import session
from health_rows import changed, sessions
from packed_pages import unpacked_pane

PLAN = MonitorPlan(baseline_sessions=30)


def life_of(name: str, left: float = 1.0, count: int = 60) -> tuple[list[SessionRow], Assessment]:
    """Return sessions of a cylinder with this share of its friction left from the 42nd on, and the assessment."""
    rows = [session(day, name, friction_n=(400.0 + day % 3) * (left if day > 40 else 1.0)) for day in range(count)]
    return rows, assess(name, rows, plan=PLAN)


def pane(folder: Path, *given: object, **options: object) -> str:
    """Write a pane and return its page."""
    (folder / "a.js").write_text(health_pane(*given, **options), encoding="utf-8")  # type: ignore[arg-type]
    return unpacked_pane(folder / "a.js")


def made(folder: Path, count: int = 4) -> tuple[CylinderLine, ...]:
    """Write the pages of a fleet whose second cylinder is worn, and its third perhaps, and return its lines."""
    lines = []
    (folder / "panes").mkdir(exist_ok=True)
    for number in range(count):
        name = f"press {number} ü#"
        rows, found = life_of(name, {1: 0.65, 2: 0.85}.get(number, 1.0))
        entries = [Entry(name, "2026-02-01T00:00:00Z", "Kim", "service", "oil changed")]
        lines.append(line_of(found, rows, {}, "state"))
        (folder / pane_file(name)).write_text(health_pane(found, rows, entries, {}), encoding="utf-8")
    ordered = in_order(lines)
    write_health_page(folder / "health.html", ordered, [Refused("x.csv", "of nobody <&>")], ["press 1 ü#: alarm"])
    return ordered


def test_what_needs_a_person_comes_first_and_each_cylinder_is_one_click_away(tmp_path: Path) -> None:
    lines = made(tmp_path)
    assert [each.answer for each in lines] == ["alarm", "undecided", "fine", "fine"]
    assert lines[0].headline == "friction -35 % since 2026-02-11"
    page = (tmp_path / "health.html").read_text()
    places = [page.index(words) for words in ("friction -35 % since", "need not be wear", "No change of friction")]
    assert places == sorted(places)
    assert "<strong>x.csv</strong>: of nobody &lt;&amp;&gt;" in page
    made(tmp_path)
    assert (tmp_path / "health.html").read_text() == page, "equal input makes equal bytes"
    write_health_page(tmp_path / "health.html", [replace(each, about="simulated: <wear>") for each in lines], [], [])
    page = (tmp_path / "health.html").read_text()
    assert page.partition('<section id="fleet">')[0].count("#pane=press") == 4, "the healthy ones too"
    assert page.count("<details><summary>About it</summary>simulated: &lt;wear&gt;</details>") == 4
    write_health_page(tmp_path / "health.html", lines * 50, [], [])
    assert (tmp_path / "health.html").stat().st_size < 3e6


def test_a_leak_has_one_unit_and_a_rate_no_more_than_was_seen(tmp_path: Path) -> None:
    rows = changed(sessions(230), 130, 60, times={"leak_m3_s_pa": 10.0, "friction_n": 0.8})
    found = assess("press", rows)
    assert "l/min at 100 bar" in found.words
    page = pane(tmp_path, found, rows, [], {})
    assert "leak [l/min at 100 bar]" in page
    assert "0.36" in page, "ten times 6e-14 m³/(s Pa)"
    assert "m³" not in page
    assert "e-13" not in page
    falling = replace(found.changes[0], indicator="friction_n", change=-80.0, per_year=-1061.0)
    assert [rate(replace(falling, change=change))[1] for change in (-90.0, -80.0, -15.0)] == ["month", "week", "day"]
    assert "<dd>-20.3 N a week" in pane(tmp_path, replace(found, changes=(falling,)), rows, [], {})


def test_an_acknowledged_alarm_and_a_silent_cylinder_find_their_places() -> None:
    rows, found = life_of("a", 0.65)
    said = line_of(replace(found, answer="watch", acknowledged="Kim, 2026-03-01"), rows, {}, "")
    assert (line_of(found, rows, {}, "").rank, said.rank) == (0, 4)
    assert said.acknowledged == "Kim, 2026-03-01"
    short, quiet = life_of("b", count=20)
    silent = in_order([line_of(quiet, short, {}, ""), said])[0]
    assert (silent.cylinder, silent.look) == ("b", "no session since 2026-01-20")
    doubtful = line_of(found, rows, {row.session: "another cylinder" for row in rows[-3:]}, "")
    assert (doubtful.look, doubtful.left_out) == ("its last 3 sessions are not assessed", 3)


def test_a_cylinder_shows_its_life_and_its_strokes(tmp_path: Path) -> None:
    made(tmp_path)
    page = unpacked_pane(tmp_path / pane_file("press 1 ü#"))
    shown = ("Then and now", "oil changed", "2026-02-11", "-35 % (-3", "MAINTENANCE_REQUIRED", "alarm at")
    assert [words for words in shown if words not in page] == []
    rows, found = life_of("a", count=1)
    page = pane(tmp_path, found, rows, [], {"a-0009": "of b"}, about="simulated: wear")
    assert "of b" in page
    assert "<summary>About this cylinder</summary><p>simulated: wear</p>" in page
    assert "no session yet" in pane(tmp_path, Assessment("a", "not yet", "no session yet"), [], [], {})


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
