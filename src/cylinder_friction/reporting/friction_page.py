"""The page of a run over logs: friction of each recording, tables that compare recordings, and the refused files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from cylinder_friction.evaluation.friction_levels import (
    PRESSURE_STEP_BAR,
    FrictionLevel,
    RecordingDifference,
    in_words,
)
from cylinder_friction.files.whole_files import write_text
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction.reporting.inspection.friction_figures import (
    cloud_against_velocity,
    measured_panels,
    of_recordings,
    velocity_panel,
)
from cylinder_friction.reporting.page import NONE, Cell, Line, Panel, Table, number_cell, over_time, packed, page_html
from cylinder_friction.reporting.style import GREEN, PALE, QUIET

POINTS = 1000


def pane_file(name: str) -> str:
    """Name the file of a recording's pane; the page loads it once it is chosen."""
    return f"panes/{name}.js"


def friction_pane(recording: Recording) -> str:
    """Write the pane of a recording as a script that passes it to the page; equal input makes equal text.

    The recording has raw columns, ``velocity_m_s``, ``friction_n``, ``lower_n`` and ``upper_n`` [N], and ``label_n`` if
    friction comes from an estimator.
    """
    lower_n, velocity_m_s = _usable(recording, "lower_n"), recording.column("velocity_m_s")
    friction_n, friction = _usable(recording, "friction_n"), list[Line]()
    if np.isfinite(lower_n).any():
        upper = Line("bounds", _usable(recording, "upper_n"), PALE, 1.0, in_legend=False)
        friction += [Line("bounds", lower_n, PALE, 1.0), upper]
    if "label_n" in recording.columns:
        friction.append(Line("label, off line", _usable(recording, "label_n"), QUIET, 1.0))
    friction.append(Line("friction", friction_n, GREEN, 1.5))
    panels = [Panel("friction [N]", friction, 1.6), velocity_panel(velocity_m_s), *measured_panels(recording)]
    html = page_html(
        "templates/friction_pane.html.j2",
        title=recording.name,
        origin=_origin(recording.metadata),
        time=over_time(recording.column("time_s"), panels, 2, POINTS),
        velocity=cloud_against_velocity(velocity_m_s, friction_n, POINTS // 2),
    )
    return f"pane({json.dumps(recording.name)}, {json.dumps(packed(html, 1))});\n"


def write_friction_page(
    path: Path,
    rows: Sequence[tuple[str, str, float | None, str, str]],
    offsets: Sequence[KnownOffset],
    bounds: str,
    guessed: Mapping[str, Any] | None = None,
    levels: Sequence[tuple[str, str, Table]] = (),
) -> None:
    """Write the page whole, beside its panes; equal input makes equal bytes.

    ``rows`` hold name, start, friction [N], usable share and remarks of every recording, and of every refused file with
    an empty share. ``offsets`` are empty with an estimator. ``bounds`` states what lies between the bounds, ``levels``
    are of ``level_tables``, and ``guessed`` is as in ``FrictionOfLogs``.
    """
    cells: list[list[str | Cell]] = [
        [
            Cell(name, link=f"#pane={quote(name)}" if usable else ""),
            Cell(start[:16].replace("T", " ") + "Z" * start.endswith("Z")) if start else NONE,
            number_cell(friction_n),
            usable or NONE,
            Cell(words, style="words"),
        ]
        for name, start, friction_n, usable, words in rows
    ]
    recordings = [(name, friction_n) for name, _, friction_n, usable, _ in rows if usable]
    head = (
        "recording",
        Cell("start", tip="of the first sample; without Z by the logger's clock, whose time zone is not stated"),
        Cell("friction [N]", tip="half of extending less retracting at equal position"),
        "usable rows [%]",
        "remarks",
    )
    html = page_html(
        "templates/friction.html.j2",
        title="Friction",
        table_of_all=Table(head, cells, words=(4,), sortable=True),
        offsets=offset_table(offsets) if offsets else None,
        comparison=of_recordings(recordings),
        recordings=[name for name, _ in recordings],
        bounds=bounds,
        levels=levels,
        guessed=None if guessed is None else (guessed["from"], guess_table(guessed)),
    )
    write_text(path, html)


def _origin(about: RecordingMetadata) -> list[tuple[str, str]]:
    """List the facts about a recording's origin: a name and its value."""
    start = f"{about.start} ({about.start_source})" if about.start else "not known"
    sensors = [
        (f"sensor of {column}", ", ".join(f"{name} {value}" for name, value in known.items()))
        for column, known in about.sensors.items()
    ]
    hashes = {about.source_file or "its file": about.source_sha256} | dict(about.depends_on)
    return [
        ("start", start),
        *[(name, value) for name, value in (("machine", about.asset), ("cylinder", about.cylinder)) if value],
        ("condition, session", f"{about.condition}, {about.session}"),
        *sensors,
        ("SHA-256", ", ".join(f"{name} {value[:12]}" for name, value in hashes.items() if value)),
    ]


def guess_table(guessed: Mapping[str, Any]) -> Table:
    """Tabulate the columns whose channel and unit were guessed."""
    rows: list[list[str | Cell]] = [
        [column, each["channel"], each["unit"] or "–"]
        + [Cell("; ".join(each[key]), style="words") for key in ("reasons", "check")]
        for column, each in guessed["columns"].items()
    ]
    return Table(("column", "channel", "unit", "because", "to check"), rows, words=(1, 2, 3, 4), style="stacked")


def _usable(recording: Recording, column: str) -> np.ndarray:
    return np.where(recording.usable(), recording.column(column), np.nan)


def level_tables(
    found: Sequence[RecordingDifference], levels: Mapping[str, Sequence[FrictionLevel]]
) -> list[tuple[str, str, Table]]:
    """List title, explanation and rows of each table; none if nothing slides steadily."""
    tables = []
    if found:
        words = (
            "Mean friction of each recording's steady sliding (other rows than those of friction at equal position "
            "above), and how far it is from the median of the other recordings. The columns after that compare only "
            f"rows of equal pressure (sum of both, in steps of {PRESSURE_STEP_BAR:g} bar), of equal speed (within a "
            "factor of two) or of equal direction. What is left with all three equal, ± twice its standard error, is "
            "not explained by them. "
        )
        rows: list[list[str | Cell]] = []
        for each in found:
            equal = [getattr(each.equal, name, None) for name in ("newtons", "half_width_n", "seconds")]
            numbers = each.friction_n, each.differs_n, *each.left_n.values(), *equal
            rows.append([each.name, *map(number_cell, numbers)])
        factors = [f"equal {factor} [N]" for factor in found[0].left_n]
        head = ("recording", "steady sliding [N]", "differs by [N]", *factors, "all three [N]", "± [N]", "compared [s]")
        if sentence := in_words(found):
            words += f"{sentence[0].upper()}{sentence[1:]}."
        tables.append(("What differs between recordings", words, Table(head, rows, sortable=True)))
    steps = sorted({each.pressure_bar for own in levels.values() for each in own})
    if steps:
        rows = [[name, *(_at(own, step) for step in steps)] for name, own in levels.items() if own]
        head = ("recording", *(f"{step:g} to {step + PRESSURE_STEP_BAR:g} bar" for step in steps))
        words = (
            "Friction of steady sliding against the motion, extending / retracting [N], by the sum of both pressures."
        )
        tables.append(("Friction by pressure", words, Table(head, rows)))
    return tables


def _at(levels: Sequence[FrictionLevel], pressure_bar: float) -> Cell:
    """Compute the mean friction extending and retracting at one level of pressure."""
    both = []
    for direction in (1, -1):
        own = [each for each in levels if each.pressure_bar == pressure_bar and each.direction == direction]
        seconds = sum(each.seconds for each in own)
        both.append(f"{sum(each.friction_n * each.seconds for each in own) / seconds:z.0f}" if own else "–")
    return Cell(" / ".join(both)) if both != ["–", "–"] else NONE


def offset_lines(offsets: Sequence[KnownOffset]) -> list[str]:
    """List the lines of the printed report, one per session below a head."""
    width, space = (max(len(getattr(each, name)) for each in offsets) for name in ("session", "value"))
    lines = [f"  {each.session:<{width}}  {each.value:<{space}}  {each.source}: {each.words}" for each in offsets]
    return ["offset that the sensors' zeros add to friction, by session (k = 2, about 95 %)", *lines]


def offset_table(offsets: Sequence[KnownOffset]) -> Table:
    """Tabulate the sessions."""
    rows: list[list[str | Cell]] = [
        [
            each.session,
            *(number_cell(number, "z.1f") for number in (each.offset_n, each.uncertainty_n, each.stated_n)),
            each.source,
            Cell(each.words, style="words"),
        ]
        for each in offsets
    ]
    head = ("session", "offset [N]", "± [N]", "stated ± [N]", "known from", "how")
    return Table(head, rows, words=(4, 5), style="stacked")
