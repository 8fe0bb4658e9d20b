"""The inspection of a file or a folder as one HTML page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.recordings.files import write_text
from cylinder_friction.reporting.inspection.choice import PLOTTED, chosen
from cylinder_friction.reporting.inspection.html_page import Pane, page_html
from cylinder_friction.reporting.inspection.overview_pane import overview
from cylinder_friction.reporting.inspection.recording_pane import recording_pane
from cylinder_friction.reporting.inspection.subject import titles

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.reporting.inspection.subject import Inspected
    from cylinder_friction.signals.smooth_signals import SignalFilter


def write_page(
    path: Path,
    subjects: Sequence[Inspected],
    cylinder: Cylinder,
    filters: Mapping[str, SignalFilter],
    method: str = "savitzky_golay",
    end_stop_margin_m: float = 0.003,
    plotted: int = PLOTTED,
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

    Raises:
        ValueError: The method is not one of the filters.
    """
    if method not in filters:
        raise ValueError(f"method: expected one of {', '.join(filters)}, but got {method!r}")
    panes: list[Pane] = []
    names: dict[int, str] = {}
    named = titles(subjects)
    for index in chosen(subjects, plotted):
        subject = subjects[index]
        assert subject.recording is not None
        names[index] = f"recording-{index + 1}"
        panes.append(
            recording_pane(
                names[index], named[index], subject, subject.recording, cylinder, filters, method, end_stop_margin_m
            )
        )
    first = overview(subjects, names, _lead(subjects, len(panes)))
    write_text(path, page_html("Inspection of recordings", [first, *panes]))


def _lead(subjects: Sequence[Inspected], shown: int) -> str:
    readable = sum(subject.seen is not None for subject in subjects)
    if readable > shown:
        return (
            f"{shown} of {readable} recordings that could be read are shown with figures, refused ones before others; "
            "inspect another file by itself to see its own."
        )
    if shown == 0:
        return "Nothing could be read far enough to be drawn."
    return "Choose a recording at the left to see its figures."
