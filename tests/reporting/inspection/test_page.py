"""The page: what is on it, that it needs nothing from outside, its size, and how it looks in a browser."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from cylinder_friction.evaluation.inspection.subject import Inspected
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.checks.limits import Finding
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.inspection.recording_pane import Panes
from cylinder_friction.signals.smooth_signals import SignalFilter
from inspected_recordings import made_panes, stated, write_page_of
from packed_pages import unpacked

Filters = dict[str, "SignalFilter"]
OK = Finding("rate", "ok", "200 Hz")
REFUSED = Inspected("<b>.csv", [Finding("unit", "refused", "position_m is 251 m & more")])
FIGURES = 4
"""Of a file with friction: against velocity, over time, against position, spectra."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, strokes: Recording, labeller: Labeller, filters: Filters) -> Path:
    """The page of a file that is in order and of one that is refused."""
    path = tmp_path_factory.mktemp("written") / "page.html"
    write_page_of(path, [Inspected("a.csv", [OK], stated(strokes)), REFUSED], labeller, filters)
    return path


def test_friction_comes_first_and_files_outcomes_reasons_and_figures_follow(written: Path) -> None:
    text = unpacked(written.read_text(encoding="utf-8"))
    for words in (
        "&lt;b&gt;.csv",
        "not usable: position_m is 251 m &amp; more",
        "usable for labelling.",
        "P1, piston side",
        "friction [N]",
        "Stribeck velocity",
        "N·s/m",
        "Load: none.",
        "noise level",
        "savitzky_golay, one-sided",
        "rts, Kalman filter",
    ):
        assert words in text, words
    pane = text[text.index('<section id="recording-1">') :]
    assert re.search(r"friction while extending</dt><dd>3\d\d ± \d+ N", pane)
    assert pane.index("friction while retracting") < pane.index('class="plot"') < pane.index("Checks: 2")
    assert text.index("Friction while sliding") < text.index("<table")
    assert text.count('class="plot"') == FIGURES + 1  # and what filters cost


def test_it_fetches_nothing(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    for page in (text, unpacked(text)):
        assert not re.search(r"<(?:script|link|img)[^>]*\s(?:src|href)=", page)


def test_equal_input_makes_equal_bytes(
    tmp_path: Path, written: Path, strokes: Recording, labeller: Labeller, filters: Filters
) -> None:
    write_page_of(tmp_path / "page.html", [Inspected("a.csv", [OK], stated(strokes)), REFUSED], labeller, filters)
    assert (tmp_path / "page.html").read_bytes() == written.read_bytes()


@pytest.mark.extended
def test_thirty_files_of_a_minute_have_all_figures_in_less_than_5_megabytes(
    tmp_path: Path, strokes: Recording, labeller: Labeller, filters: Filters
) -> None:
    """Every tenth file is drawn; they weigh the same, as the number of files alone decides on their detail."""
    noise = np.random.default_rng(0).normal(0.0, 0.1, len(strokes))
    recording = strokes.with_columns(oil_temperature_c=40.0 + noise)
    subjects = [Inspected(f"{number}.csv", [OK], recording) for number in range(3)]
    panes, _ = made_panes(subjects, labeller, filters, files=30)
    without = write_page_of(tmp_path / "page.html", [REFUSED], labeller, filters)
    assert len(without) + 10 * sum(len(pane.html) for pane in panes) < 5_000_000
    assert all(len(pane.html) > 30_000 for pane in panes)


def test_all_files_have_figures_in_their_order_and_bad_ones_lose_nothing(
    tmp_path: Path, strokes: Recording, labeller: Labeller, filters: Filters
) -> None:
    good = [Inspected(f"{name}.csv", [OK], strokes) for name in "zay"]
    bad = Inspected("m.csv", [Finding("motion", "refused", "does not move")], strokes)
    text = write_page_of(tmp_path / "page.html", [good[0], REFUSED, good[1], bad, good[2]], labeller, filters)
    assert re.findall(r'<a href="#recording-\d">(\d\. [^<]*)', text) == [
        "1. z.csv",
        "2. &lt;b&gt;.csv",
        "3. a.csv",
        "4. m.csv",
        "5. y.csv",
    ]
    panes = text[: text.index('<section id="filters">')].split('<section id="recording-')[1:]
    assert [pane.count('class="plot"') for pane in panes] == [FIGURES, 0, FIGURES, FIGURES, FIGURES]
    assert "drawn to show what is wrong, and is no result" in panes[3]
    assert "friction while extending" not in panes[3]
    assert '"number of the file"' in text
    assert '"hovermode":"closest","showlegend":true' in text  # friction against velocity names its files


def test_a_recording_shorter_than_the_filter_is_shown_with_the_reason(
    tmp_path: Path, strokes: Recording, labeller: Labeller, filters: Filters
) -> None:
    short = Recording(strokes.metadata, strokes.table.iloc[:30])
    text = write_page_of(tmp_path / "page.html", [Inspected("a.csv", [OK], short)], labeller, filters)
    assert "not usable: friction cannot be calculated: got 30 samples" in text
    assert text.count('class="plot"') == 1


def test_a_drive_force_and_further_columns_are_drawn(
    tmp_path: Path, strokes: Recording, labeller: Labeller, filters: Filters
) -> None:
    table = strokes.table.drop(columns=["pressure_1_pa", "pressure_2_pa"])
    table = table.assign(
        drive_force_n=300.0 * np.sign(np.gradient(strokes.column("position_m"))), oil_temperature_c=41.0
    )
    subject = Inspected("a.csv", [OK], replace(strokes, columns=table))
    text = write_page_of(tmp_path / "page.html", [subject], labeller, filters)
    assert "oil [°C]" in text
    assert text.count('"name":"drive force"') == 2
    assert "piston side" not in text


def test_several_rates_are_warned_of(tmp_path: Path, strokes: Recording, labeller: Labeller, filters: Filters) -> None:
    slower = Recording(replace(strokes.metadata, sample_time_s=0.01), strokes.table.iloc[::2].reset_index(drop=True))
    subjects = [Inspected("a.csv", [OK], strokes), Inspected("b.csv", [OK], slower)]
    warning = "The usable files come at 200 and 100 Hz. ingest takes those of the commonest rate alone"
    assert warning in write_page_of(tmp_path / "page.html", subjects, labeller, filters)
    assert "The usable files come at" not in write_page_of(tmp_path / "page.html", subjects[:1], labeller, filters)


def test_an_unknown_filter_is_refused(labeller: Labeller, filters: Filters) -> None:
    with pytest.raises(ValueError, match=r"method: expected one of adaptive, .*, but got 'median'"):
        Panes(labeller, filters, "median")


@pytest.mark.extended
def test_a_browser_draws_every_figure_without_an_error_and_filters_the_table(
    tmp_path: Path, written: Path, new_page: Callable[..., Page]
) -> None:
    page = new_page(1500, 1000)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(written.as_uri())
    page.get_by_role("button", name=re.compile("refused")).click()
    assert page.locator("#files tbody tr:visible").count() == 1
    page.get_by_role("link", name="a.csv").first.click()
    page.locator("#recording-1 .plot").first.wait_for()
    assert page.locator("#recording-1 .plot").count() == FIGURES
    for number in range(FIGURES):
        page.locator("#recording-1 .plot").nth(number).scroll_into_view_if_needed()
        page.locator("#recording-1 .plot").nth(number).locator(".main-svg").first.wait_for()
    page.set_viewport_size({"width": 400, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") == 400
    assert page.locator("#files").is_hidden()
    page.screenshot(path=str(tmp_path / "page.png"), full_page=True)
    page.get_by_role("link", name="Files").click()
    page.get_by_role("button", name=re.compile("refused")).click()
    assert page.evaluate("document.documentElement.scrollWidth") == 400
    for verdict in ("usable for labelling", "not usable: position_m is 251 m & more"):
        box = page.get_by_role("cell", name=verdict, exact=True).bounding_box()
        assert box is not None
        assert box["x"] + box["width"] <= 400
    assert errors == []
