"""The inspection of a file or a folder as one HTML page: a list of all files, and a pane for each that is drawn."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.files import write_text
from cylinder_friction.reporting.inspection.choice import PLOTTED, chosen
from cylinder_friction.reporting.inspection.friction_figures import compared
from cylinder_friction.reporting.inspection.recording_pane import MM_PER_M, Pane, recording_pane
from cylinder_friction.reporting.inspection.sensor_offsets import KnownOffset, offset_table
from cylinder_friction.reporting.inspection.subject import OUTCOMES, Inspected, count_outcomes, titles
from cylinder_friction.reporting.page import Cell, Table, page_html
from cylinder_friction.signals.smooth_signals import SignalFilter

MEANINGS = {
    "ok": "usable as it came",
    "noted": "usable; something is worth knowing",
    "repaired": "usable after the repairs that are named",
    "refused": "not usable, for the reason given",
}
FULL_DETAIL = 2
"""So many recordings are drawn with every point that a screen can show; with more, each gets fewer."""


def write_page(
    path: Path,
    subjects: Sequence[Inspected],
    cylinder: Cylinder,
    filters: Mapping[str, SignalFilter],
    method: str = "savitzky_golay",
    end_stop_margin_m: float = 0.003,
    plotted: int = PLOTTED,
    offsets: Sequence[KnownOffset] = (),
) -> None:
    """Write the page whole; equal input makes equal bytes.

    Args:
        path: Of the HTML file.
        subjects: What was inspected, in the order to be shown.
        cylinder: Its areas, stroke and moving mass.
        filters: By name, as ``filters_by_method`` gives them.
        method: Which of them velocity and friction are shown with.
        end_stop_margin_m: Rows this near an end stop are not usable [m].
        plotted: How many files get figures, see ``chosen``.
        offsets: What is known of the pressure sensors' offset in each session.

    Raises:
        ValueError: The method is not one of the filters.
    """
    if method not in filters:
        raise ValueError(f"method: expected one of {', '.join(filters)}, but got {method!r}")
    named, places = titles(subjects), chosen(subjects, plotted)
    detail = min(1.0, FULL_DETAIL / max(1, len(places)))
    panes = {
        place: recording_pane(
            f"recording-{place + 1}",
            named[place],
            subjects[place],
            cylinder,
            filters,
            method,
            end_stop_margin_m,
            detail,
        )
        for place in places
    }
    counts = count_outcomes(subjects)
    html = page_html(
        "templates/inspection.html.j2",
        title="Inspection of recordings",
        lead=_lead(subjects, len(panes)),
        counts=[(outcome, counts[outcome], MEANINGS[outcome]) for outcome in OUTCOMES if counts[outcome]],
        files=_files(subjects, named, panes),
        offsets=offset_table(offsets) if offsets else None,
        comparison=compared({pane.title: pane.view for pane in panes.values() if pane.view is not None}),
        panes=list(panes.values()),
        method=method,
        alone=len(subjects) == 1,
    )
    write_text(path, html)


def _lead(subjects: Sequence[Inspected], shown: int) -> str:
    readable = sum(subject.seen is not None for subject in subjects)
    if readable > shown:
        return (
            f"{shown} of {readable} recordings that could be read are shown with figures, refused ones before others; "
            "inspect another file by itself to see its own."
        )
    if shown == 0:
        return "Nothing could be read far enough to be drawn."
    return "Choose a recording to see its figures."


def _files(subjects: Sequence[Inspected], named: Sequence[str], panes: Mapping[int, Pane]) -> Table:
    """Return one row per file or piece: its outcome, the reason, its friction and its extent."""
    rows: list[list[str | Cell]] = []
    for place, (title, subject) in enumerate(zip(named, subjects, strict=True)):
        reasons = subject.reasons() or ([] if subject.seen is not None else ["became no recording"])
        friction_n = panes[place].friction_n if place in panes else subject.friction_n
        numbers = ["", "", ""]
        if (seen := subject.seen) is not None:
            numbers = [
                f"{seen.rows * seen.sample_time_s:.5g}",
                f"{1.0 / seen.sample_time_s:.5g}",
                f"{MM_PER_M * seen.least_position_m:.4g} to {MM_PER_M * seen.greatest_position_m:.4g}",
            ]
        rows.append(
            [
                Cell(title, link=f"#{panes[place].name}" if place in panes else ""),
                Cell(subject.outcome, badge=True, style="words badged"),
                Cell(f"{friction_n:.0f}", value=friction_n) if math.isfinite(friction_n) else Cell("–", style="none"),
                Cell(reasons[0] if reasons else "", more=reasons[1:], style="words"),
                *numbers,
            ]
        )
    friction = Cell("friction [N]", tip="half of extending less retracting at equal position")
    head: list[str | Cell] = ["file", "outcome", friction, "why", "duration [s]", "rate [Hz]", "travel [mm]"]
    outcomes = [subject.outcome for subject in subjects]
    return Table(head, rows, words=(1, 3), sortable=True, outcomes=outcomes)
