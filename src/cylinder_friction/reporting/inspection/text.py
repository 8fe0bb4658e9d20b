"""The checks as plain text, for the terminal."""

from collections.abc import Sequence

from cylinder_friction.reporting.inspection.sensor_offsets import KnownOffset, offset_lines
from cylinder_friction.reporting.inspection.subject import OUTCOMES, Inspected, count_outcomes, titles


def text_report(subjects: Sequence[Inspected], offsets: Sequence[KnownOffset] = ()) -> str:
    """Return one block a file, one line a check with its outcome, the sessions' offsets, and a count of the files."""
    blocks = [_block(title, subject) for title, subject in zip(titles(subjects), subjects, strict=True)]
    if offsets:
        blocks.append("\n".join(offset_lines(offsets)))
    return "\n\n".join([*blocks, _summary(subjects)]) + "\n"


def _block(title: str, subject: Inspected) -> str:
    lines = [(finding.outcome, finding.check, finding.text) for finding in subject.findings]
    lines += [("repaired", "repair", text) for text in subject.all_repairs()]
    if subject.seen is None and all(outcome != "refused" for outcome, _, _ in lines):
        lines.append(("refused", "file", "became no recording"))
    width = max((len(check) for _, check, _ in lines), default=0)
    shown = [f"  {outcome:<8}  {check:<{width}}  {text}".rstrip() for outcome, check, text in lines]
    return "\n".join([f"{title}: {subject.outcome}", *shown])


def _summary(subjects: Sequence[Inspected]) -> str:
    counts = count_outcomes(subjects)
    total = sum(counts.values())
    shown = ", ".join(f"{counts[outcome]} {outcome}" for outcome in OUTCOMES if counts[outcome])
    return f"{total} {'file' if total == 1 else 'files'}" + (f": {shown}" if shown else "")
