"""The offset of the sensors' zeros by session, as lines of text and as a table of a page."""

from collections.abc import Sequence

from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.reporting.page import Cell, Table, number_cell


def offset_lines(offsets: Sequence[KnownOffset]) -> list[str]:
    """Return the lines of the printed report, one per session below a head."""
    width, space = (max(len(getattr(each, name)) for each in offsets) for name in ("session", "value"))
    lines = [f"  {each.session:<{width}}  {each.value:<{space}}  {each.source}: {each.words}" for each in offsets]
    return ["offset of the sensors' zeros by session, as friction (k = 2)", *lines]


def offset_table(offsets: Sequence[KnownOffset]) -> Table:
    """Return one row per session."""
    rows: list[list[str | Cell]] = [
        [
            each.session,
            *(number_cell(number, ".1f") for number in (each.offset_n, each.uncertainty_n, each.stated_n)),
            each.source,
            Cell(each.words, style="words"),
        ]
        for each in offsets
    ]
    head = ("session", "offset [N]", "± [N]", "stated ± [N]", "known from", "how")
    return Table(head, rows, words=(4, 5), style="stacked")
