"""The page of a run over logs: every recording's friction over time and over velocity, and what was refused."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cylinder_friction.evaluation.inspection.friction_view import FrictionView
from cylinder_friction.friction_models.identification.steady_points import SteadyPoint
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.recordings.files import write_text
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.inspection.friction_figures import against_velocity, compared
from cylinder_friction.reporting.inspection.recording_pane import (
    calculated_panels,
    measured_panels,
    stribeck_table,
)
from cylinder_friction.reporting.offset_table import offset_table
from cylinder_friction.reporting.page import Cell, Table, page_html
from cylinder_friction.reporting.page_figure import PageFigure
from cylinder_friction.reporting.style import GREEN, PALE, QUIET
from cylinder_friction.reporting.time_figure import Line, Panel, over_time

POINTS = 1200


@dataclass(frozen=True)
class FrictionPane:
    """One recording's part of the page."""

    title: str
    points: tuple[SteadyPoint, ...]  # Of steady sliding
    figures: dict[str, PageFigure]  # ``time``, and ``velocity`` where the piston slides
    table: Table | None  # Of the Stribeck curve, or of the points of steady sliding
    seen: str  # What the curve comes from
    no_curve: str  # Why no Stribeck curve is stated; empty where it is
    shown: str = ""  # Which part of a long recording the figures show; empty for all of it


def friction_pane(view: FrictionView) -> FrictionPane:
    """Return the pane of a recording.

    Args:
        view: Of a recording with raw columns beside ``friction_n``, ``lower_n`` and ``upper_n`` [N], and with
            ``label_n`` where friction is an estimator's.
    """
    recording = view.labelled
    friction = [
        Line("bounds", _usable(recording, "lower_n"), PALE, 1.0),
        Line("bounds", _usable(recording, "upper_n"), PALE, 1.0, in_legend=False),
        *([Line("label, off line", _usable(recording, "label_n"), QUIET, 1.0)] if "label_n" in recording.table else []),
        Line("friction", _usable(recording, "friction_n"), GREEN, 1.5),
    ]
    velocity, _ = calculated_panels(view)
    panels = [Panel("friction [N]", friction, 1.6), velocity, *measured_panels(recording)]
    figures = {"time": over_time(recording.column("time_s"), panels, 2, POINTS)}
    if view.points:
        figures["velocity"] = against_velocity(view, POINTS)
    return FrictionPane(recording.name, view.points, figures, *stribeck_table(view), view.no_curve)


def write_friction_page(
    path: Path,
    panes: Sequence[FrictionPane],
    offsets: Sequence[KnownOffset],
    rows: Sequence[tuple[str, str, str, str]],
    bounds: str,
    guessed: Mapping[str, Any] | None = None,
) -> None:
    """Write the page whole; equal input makes equal bytes.

    Args:
        path: Of the HTML file.
        panes: What is drawn, in this order.
        offsets: What is known of the pressure sensors' offset in each session; none with an estimator.
        rows: Name, friction, usable share and remarks of every recording and refused file.
        bounds: What the bounds hold, in words.
        guessed: From which file channels and units were guessed, and each column's; None if a mapping states them.
    """
    titles = {pane.title: f"recording-{number}" for number, pane in enumerate(panes, start=1)}
    cells: list[list[str | Cell]] = [
        [Cell(name, link=f"#{titles[name]}" if name in titles else ""), friction, usable, Cell(words, style="words")]
        for name, friction, usable, words in rows
    ]
    head = (
        "recording",
        Cell("friction [N]", tip="half of extending less retracting at equal position"),
        "usable rows [%]",
        "remarks",
    )
    html = page_html(
        "templates/friction.html.j2",
        title="Friction",
        table_of_all=Table(head, cells, words=(3,), sortable=True),
        offsets=offset_table(offsets) if offsets else None,
        comparison=compared({pane.title: pane.points for pane in panes}),
        panes=[(titles[pane.title], pane) for pane in panes],
        left_out=len(rows) - len(panes),
        bounds=bounds,
        guessed=None if guessed is None else (guessed["from"], guess_table(guessed)),
    )
    write_text(path, html)


def guess_table(guessed: Mapping[str, Any]) -> Table:
    """Return one row per column whose channel and unit were guessed."""
    rows: list[list[str | Cell]] = [
        [column, each["channel"], each["unit"] or "–", str(each["sign"])]
        + [Cell("; ".join(each[key]), style="words") for key in ("reasons", "check")]
        for column, each in guessed["columns"].items()
    ]
    return Table(
        ("column", "channel", "unit", "sign", "because", "to check"), rows, words=(1, 2, 4, 5), style="stacked"
    )


def _usable(recording: Recording, column: str) -> np.ndarray:
    return np.where(recording.usable(), recording.column(column), np.nan)
