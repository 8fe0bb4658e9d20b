"""What charts with one row a model have in common: names at the left, a scale in the middle, a number at the right."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from friction_benchmark.report.drawing import WIDTH, Drawing, text_width

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_benchmark.report.model_titles import Names
    from friction_benchmark.results import Entry

ROW = 22.0
TOP = 34.0
FOOT = 40.0
NUMBERS = 58.0
SMALL = 12.0

TEST_MARKS = (
    ("#0072B2", "circle"),
    ("#D55E00", "square"),
    ("#009E73", "triangle"),
    ("#CC79A7", "diamond"),
    ("#7A5A00", "down"),
    ("#56B4E9", "cross"),
)
"""Colour and shape of each test, in their order; they begin anew where there are more."""


def fitting(words: str, width: float, size: float) -> str:
    """Return words cut with an ellipsis where they are wider than ``width`` [px]."""
    if text_width(words, size) <= width:
        return words
    return words[: max(1, int(width / text_width(" ", size)) - 1)].rstrip() + "…"


@dataclass(frozen=True)
class Rows:
    """A chart begun: its drawing, the ends of the scale [px], the height of every row and of the axis."""

    drawing: Drawing
    start: float
    end: float
    places: tuple[float, ...]
    bottom: float

    @property
    def top(self) -> float:
        return TOP

    def number(self, row: int, words: str, style: str = "") -> None:
        """Write a number behind a row."""
        self.drawing.text(WIDTH - 4.0, self.places[row] + 4.0, words, "end", SMALL, style)


def begun(entries: Sequence[Entry], names: Names, floor: str, words: str, over_numbers: str) -> Rows:
    """Return a chart with its rows, names and marks of family; axis and points are the caller's.

    Args:
        entries: One row each, from the top.
        names: Titles and marks.
        floor: Model whose row is shaded.
        words: What the picture shows, for those who cannot see it.
        over_numbers: Head of the numbers at the right.
    """
    titles = [names.title(entry.model) for entry in entries]
    left = min(250.0, max(text_width(title, SMALL) for title in titles) + 26.0)
    bottom = TOP + ROW * len(entries)
    drawing = Drawing(bottom + FOOT, words)
    places = tuple(TOP + ROW * (row + 0.5) for row in range(len(entries)))
    for entry, title, y in zip(entries, titles, places, strict=True):
        if entry.model == floor:
            drawing.box(0.0, y - 0.5 * ROW, WIDTH, ROW, "#F1F3F5")
        colour, shape = names.mark(entry.model)
        drawing.mark(8.0, y, shape, colour, 4.0)
        drawing.text(18.0, y + 4.0, fitting(title, left - 20.0, SMALL), size=SMALL, tip=title)
    drawing.text(WIDTH - 4.0, TOP - 8.0, over_numbers, "end", 11.0, "quiet")
    return Rows(drawing, left + 6.0, WIDTH - NUMBERS - 6.0, places, bottom)
