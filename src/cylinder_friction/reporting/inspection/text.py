"""The verdicts and the checks as plain text, for the terminal."""

from collections.abc import Sequence

from cylinder_friction.evaluation.inspection.subject import OUTCOMES, Inspected, count_outcomes
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.reporting.offset_table import offset_lines


def text_report(subjects: Sequence[Inspected], offsets: Sequence[KnownOffset] = ()) -> str:
    """Return one block a file, one line a check with its outcome, the sessions' offsets, and a count of the files."""
    blocks = [_block(subject) for subject in subjects]
    if offsets:
        blocks.append("\n".join(offset_lines(offsets)))
    return "\n\n".join([*blocks, _summary(subjects)]) + "\n"


def _block(subject: Inspected) -> str:
    width = max((len(finding.check) for finding in subject.findings), default=0)
    lines = [f"  {each.outcome:<8}  {each.check:<{width}}  {each.text}" for each in subject.findings]
    return "\n".join([f"{subject.title}: {subject.verdict}", *lines])


def _summary(subjects: Sequence[Inspected]) -> str:
    counts = count_outcomes(subjects)
    total = sum(counts.values())
    shown = ", ".join(f"{counts[outcome]} {outcome}" for outcome in OUTCOMES if counts[outcome])
    return f"{total} {'file' if total == 1 else 'files'}" + (f": {shown}" if shown else "")
