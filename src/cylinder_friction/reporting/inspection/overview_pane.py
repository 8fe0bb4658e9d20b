"""The first pane: every file, its outcome and the reason."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from cylinder_friction.reporting.inspection.html_page import Pane, badge, breakable
from cylinder_friction.reporting.inspection.subject import OUTCOMES, count_outcomes, titles

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cylinder_friction.reporting.inspection.subject import Inspected

MEANINGS = {
    "ok": "usable as it came",
    "noted": "usable; something is worth knowing",
    "repaired": "usable after the repairs that are named",
    "refused": "not usable, for the reason given",
}


def overview(subjects: Sequence[Inspected], panes: Mapping[int, str], lead: str) -> Pane:
    """Return the pane.

    Args:
        subjects: All that was inspected.
        panes: Name of the pane of each subject that has one, by its place in ``subjects``.
        lead: One sentence below the head.
    """
    pane = Pane("files", "Files")
    pane.text(lead, "quiet")
    counts = count_outcomes(subjects)
    buttons = "".join(
        f'<button data-outcome="{outcome}" aria-pressed="false" title="{MEANINGS[outcome]}; click to see only these" '
        f'onclick="only(this)"><strong>{counts[outcome]}</strong>{badge(outcome)}</button>'
        for outcome in OUTCOMES
        if counts[outcome]
    )
    pane.raw(f'<div class="counts">{buttons}</div>')
    rows = "".join(
        _row(title, subject, panes.get(index))
        for index, (title, subject) in enumerate(zip(titles(subjects), subjects, strict=True))
    )
    head = "<th>outcome</th><th>file</th><th>why</th>" + "".join(
        f'<th class="number">{words}</th>' for words in ("duration [s]", "rate [Hz]", "travel [mm]")
    )
    pane.raw(f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>')
    return pane


def _row(title: str, subject: Inspected, pane: str | None) -> str:
    name = breakable(title)
    link = f'<a href="#{pane}">{name}</a>' if pane else name
    cells = f"<td>{badge(subject.outcome)}</td><td>{link}</td>"
    cells += f'<td class="words">{_reasons(subject)}</td>'
    numbers = ("", "", "")
    seen = subject.seen
    if seen is not None:
        numbers = (
            f"{seen.rows * seen.sample_time_s:.5g}",
            f"{1.0 / seen.sample_time_s:.5g}",
            f"{1e3 * seen.least_position_m:.4g} to {1e3 * seen.greatest_position_m:.4g}",
        )
    cells += "".join(f'<td class="number">{cell}</td>' for cell in numbers)
    return f'<tr data-outcome="{subject.outcome}">{cells}</tr>'


def _reasons(subject: Inspected) -> str:
    """Return the first reason, and the others folded below it."""
    reasons = [html.escape(reason) for reason in subject.reasons()]
    if not reasons:
        return "" if subject.seen is not None else "became no recording"
    if len(reasons) == 1:
        return reasons[0]
    others = "".join(f"<div>{reason}</div>" for reason in reasons[1:])
    return f"{reasons[0]}<details><summary>and {len(reasons) - 1} more</summary>{others}</details>"
