"""The page of a run over logs in a browser: it finds a recording, loads its pane, and states what is missing."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.friction_page import POINTS, friction_pane, pane_file, write_friction_page
from cylinder_friction.reporting.page import compact, extremes
from packed_pages import unpacked_pane

NAMES = ("press 1 é", "lift#2", "<b>3</b>")


@pytest.fixture
def page_file(tmp_path: Path, labelled_recordings: list[Recording]) -> Path:
    label = labelled_recordings[0]
    friction_n = label.column("friction_n")
    recording = label.with_columns(lower_n=friction_n - 20.0, upper_n=friction_n + 20.0)
    (tmp_path / "panes").mkdir()
    for name in NAMES[:2]:
        recording = replace(recording, metadata=replace(recording.metadata, name=name))
        (tmp_path / pane_file(name)).write_text(friction_pane(recording), encoding="utf-8")
    rows = [
        (name, "2026-03-27T09:15:00.000Z", 300.0 + place, "99", f"remark {place}") for place, name in enumerate(NAMES)
    ]
    rows.append(("bad.csv", "", None, "", "refused: no rows"))  # type: ignore[arg-type]
    write_friction_page(tmp_path / "friction.html", rows, [], "friction in 90 %")
    return tmp_path / "friction.html"


@pytest.mark.extended
@pytest.mark.parametrize("width", [1400, 400])
def test_a_recording_is_found_and_drawn(
    page_file: Path, labelled_recordings: list[Recording], new_page: Callable[..., Page], width: int
) -> None:
    page, errors = new_page(width, 900), list[str]()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(page_file.as_uri())
    page.locator("#recordings .plot .main-svg").first.wait_for()
    assert page.locator("#recordings tbody tr:visible").count() == 4
    page.locator("#find").fill("REFUSED")
    assert page.locator("#recordings tbody tr:visible").inner_text().startswith("bad.csv")
    assert page.locator("#found").inner_text() == "1 of 4"
    page.locator("#find").fill("lift")
    page.locator("#recordings tbody a:visible").click()
    page.locator("#pane .plot .main-svg").first.wait_for()
    assert page.locator("#pane").get_by_text("lift#2", exact=True).first.is_visible()
    shown = "document.querySelector('#pane .plot').data.find(line => line.name.startsWith('velocity')).y"
    expected, _ = extremes(1e3 * labelled_recordings[0].column("velocity_m_s"), POINTS)
    assert page.evaluate(f"Array.from({shown})") == compact(expected).astype(np.float32).tolist()
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.goto(f"{page_file.as_uri()}#pane=press%201%20%C3%A9")
    page.locator("#pane .plot .main-svg").first.wait_for()
    page.goto(f"{page_file.as_uri()}#pane=%3Cb%3E3%3C/b%3E")
    page.get_by_text('is not there: keep the folder "panes" beside this page').wait_for()
    assert errors == []


@pytest.mark.parametrize(("half_n", "lines"), [(20.0, 2), (np.nan, 0)])
def test_bounds_that_nobody_knows_are_not_in_the_legend(
    tmp_path: Path, labelled_recordings: list[Recording], half_n: float, lines: int
) -> None:
    label = labelled_recordings[0]
    friction_n, script = label.column("friction_n"), tmp_path / "pane.js"
    recording = label.with_columns(lower_n=friction_n - half_n, upper_n=friction_n + half_n)
    script.write_text(friction_pane(recording), encoding="utf-8")
    assert len(re.findall('"name": ?"bounds"', unpacked_pane(script))) == lines
