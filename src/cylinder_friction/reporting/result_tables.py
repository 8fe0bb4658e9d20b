"""Tables of the page on logs: friction at equal pressures and speed, and the sensors' offset by session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cylinder_friction.evaluation.friction_levels import (
    PRESSURE_STEP_BAR,
    FrictionLevel,
    RecordingDifference,
    in_words,
)
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.reporting.page import NONE, Cell, Table, number_cell


def level_tables(
    found: Sequence[RecordingDifference], levels: Mapping[str, Sequence[FrictionLevel]]
) -> list[tuple[str, str, Table]]:
    """List title, explanation and rows of each table; none if nothing slides steadily."""
    tables = []
    if found:
        words = (
            "The mean of all steady sliding, which is of other rows than friction at equal position above, against the "
            "median of the others: as it is; at equal pressures (their sum, in steps of "
            f"{PRESSURE_STEP_BAR:g} bar), at equal speed (within a factor of two) and in equal direction, each by "
            "itself; and at all three together, which is what they do not explain, ± twice its standard error. "
        )
        rows = [
            [
                each.name,
                *map(number_cell, (each.friction_n, each.differs_n, *each.left_n.values())),
                *(
                    (NONE, NONE, NONE)
                    if each.equal is None
                    else map(number_cell, (each.equal.newtons, each.equal.half_width_n, each.equal.seconds))
                ),
            ]
            for each in found
        ]
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
        both.append(f"{sum(each.friction_n * each.seconds for each in own) / seconds:.0f}" if own else "–")
    return Cell(" / ".join(both)) if both != ["–", "–"] else NONE


def offset_lines(offsets: Sequence[KnownOffset]) -> list[str]:
    """List the lines of the printed report, one per session below a head."""
    width, space = (max(len(getattr(each, name)) for each in offsets) for name in ("session", "value"))
    lines = [f"  {each.session:<{width}}  {each.value:<{space}}  {each.source}: {each.words}" for each in offsets]
    return ["offset of the sensors' zeros by session, as friction (k = 2)", *lines]


def offset_table(offsets: Sequence[KnownOffset]) -> Table:
    """Tabulate the sessions."""
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
