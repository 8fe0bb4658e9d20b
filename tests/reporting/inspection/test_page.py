"""The page: what is on it, that it needs nothing from outside, its size, and how it looks in a browser."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.inspection.friction_view import with_friction
from cylinder_friction.reporting.inspection.page import write_page
from cylinder_friction.reporting.inspection.subject import Inspected

from .conftest import made_strokes

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.signals.smooth_signals import SignalFilter

Filters = dict[str, "SignalFilter"]
CHROMIUM = Path("/usr/bin/chromium")
OK = Finding("rate", "ok", "200 Hz")
REFUSED = Inspected("<b>.csv", [Finding("unit", "refused", "position_m is 251 m & more")])


def page_of(path: Path, subjects: list[Inspected], cylinder: Cylinder, filters: Filters, **options: object) -> str:
    write_page(path, subjects, cylinder, filters, **options)  # type: ignore[arg-type]
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, strokes: Recording, cylinder: Cylinder, filters: Filters) -> Path:
    """The page of a file that is in order and of one that is refused."""
    path = tmp_path_factory.mktemp("written") / "page.html"
    write_page(path, [Inspected("a.csv", [OK], strokes), REFUSED], cylinder, filters)
    return path


def test_files_outcomes_reasons_and_figures_are_on_it(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    for words in (
        "&lt;b&gt;.csv",
        "position_m is 251 m &amp; more",
        "P1, piston side",
        "friction [N]",
        "Stribeck velocity",
        "N·s/m",
        "load = 0 (the recording has no load force)",
        "noise level",
        "savitzky_golay, one-sided",
        "rts, Kalman filter",
    ):
        assert words in text, words
    assert text.count('class="plot"') == 5


def test_it_fetches_nothing(written: Path) -> None:
    assert not re.search(r"<(?:script|link|img)[^>]*\s(?:src|href)=", written.read_text(encoding="utf-8"))


def test_equal_input_makes_equal_bytes(
    tmp_path: Path, written: Path, strokes: Recording, cylinder: Cylinder, filters: Filters
) -> None:
    write_page(tmp_path / "page.html", [Inspected("a.csv", [OK], strokes), REFUSED], cylinder, filters)
    assert (tmp_path / "page.html").read_bytes() == written.read_bytes()


@pytest.mark.slow
def test_ten_long_recordings_stay_small(tmp_path: Path, cylinder: Cylinder, filters: Filters) -> None:
    long = made_strokes(cylinder, seconds=100.0)
    text = page_of(tmp_path / "page.html", [Inspected(f"{n}.csv", [OK], long) for n in range(10)], cylinder, filters)
    assert len(text) < 3_000_000


def test_of_many_recordings_the_first_get_figures_and_all_are_listed(
    tmp_path: Path, strokes: Recording, cylinder: Cylinder, filters: Filters
) -> None:
    subjects = [Inspected(f"file{number}.csv", [OK], strokes) for number in range(5)]
    text = page_of(tmp_path / "page.html", subjects, cylinder, filters, plotted=2)
    assert text.count("<section") == 3
    assert "2 of 5 recordings that could be read are shown with figures, refused ones before others" in text
    assert all(f"file{number}.csv" in text for number in range(5))


def test_a_recording_shorter_than_the_filter_is_shown_with_the_reason(
    tmp_path: Path, strokes: Recording, cylinder: Cylinder, filters: Filters
) -> None:
    short = Recording(strokes.metadata, strokes.table.iloc[:30])
    text = page_of(tmp_path / "page.html", [Inspected("a.csv", [OK], short)], cylinder, filters)
    assert "Friction could not be calculated: got 30 samples" in text
    assert text.count('class="plot"') == 1


def test_a_load_is_warned_of(tmp_path: Path, cylinder: Cylinder, filters: Filters) -> None:
    loaded = made_strokes(cylinder, load_n=4000.0)
    text = page_of(tmp_path / "page.html", [Inspected("a.csv", [OK], loaded)], cylinder, filters)
    assert "does not turn with the direction: a load" in text
    assert "friction + load [N]" in text


def test_a_drive_force_and_further_columns_are_drawn(
    tmp_path: Path, strokes: Recording, cylinder: Cylinder, filters: Filters
) -> None:
    table = strokes.table.drop(columns=["pressure_1_pa", "pressure_2_pa"])
    table = table.assign(drive_force_n=300.0, oil_temperature_c=41.0)
    text = page_of(tmp_path / "page.html", [Inspected("a.csv", [OK], replace(strokes, table=table))], cylinder, filters)
    assert "oil [°C]" in text
    assert text.count('"name":"drive force"') == 2
    assert "piston side" not in text


def test_the_overview_shows_friction_and_one_file_opens_with_its_figures(
    tmp_path: Path, strokes: Recording, cylinder: Cylinder, filters: Filters
) -> None:
    one = page_of(tmp_path / "one.html", [Inspected("a.csv", [OK], strokes)], cylinder, filters)
    assert '<section id="recording-1" data-first>' in one
    subject = with_friction(Inspected("b.csv", [OK], strokes), cylinder, filters["savitzky_golay"], 0.003)
    assert 300.0 < subject.friction_n < 400.0
    two = page_of(tmp_path / "two.html", [Inspected("a.csv", [OK], strokes), subject], cylinder, filters, plotted=1)
    assert "data-first" not in two.split("<main>")[1]
    assert two.count(f">{subject.friction_n:.0f}</td>") == 2


def test_an_unknown_filter_is_refused(tmp_path: Path, cylinder: Cylinder, filters: Filters) -> None:
    with pytest.raises(ValueError, match=r"method: expected one of adaptive, .*, but got 'median'"):
        write_page(tmp_path / "page.html", [], cylinder, filters, method="median")


@pytest.mark.slow
@pytest.mark.skipif(not CHROMIUM.is_file(), reason=f"no Chromium at {CHROMIUM}; install the system's package")
def test_a_browser_draws_every_figure_without_an_error_and_filters_the_table(tmp_path: Path, written: Path) -> None:
    from playwright.sync_api import sync_playwright

    arguments = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=arguments)
        page = browser.new_page(viewport={"width": 1500, "height": 1000})
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(written.as_uri())
        page.get_by_role("button", name=re.compile("refused")).click()
        assert page.locator("#files tbody tr:visible").count() == 1
        page.get_by_role("link", name="a.csv").first.click()
        assert page.locator("#recording-1 .plot").count() == 5
        for number in range(5):
            page.locator("#recording-1 .plot").nth(number).scroll_into_view_if_needed()
            page.locator("#recording-1 .plot").nth(number).locator(".main-svg").first.wait_for()
        page.set_viewport_size({"width": 400, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") == 400
        assert page.locator("#files").is_hidden()
        page.screenshot(path=str(tmp_path / "page.png"), full_page=True)
        browser.close()
    assert errors == []
