"""The verdicts and problems of inspected files as plain text for the terminal."""

from collections.abc import Sequence

from cylinder_friction.evaluation.inspection.subject import OUTCOMES, VERDICTS, Inspected, count_outcomes, worst_first
from cylinder_friction.labelling.known_offset import NOTHING, STROKES, KnownOffset
from cylinder_friction.reporting.friction_page import offset_lines
from cylinder_friction.wording import counted

STILL_IN = "means above hold these offsets; `estimate` and the stage `offset` take off what strokes show"


def text_report(subjects: Sequence[Inspected], offsets: Sequence[KnownOffset] = ()) -> str:
    """Write one line per file with its problems below it, then the sessions' offsets and a count of the files."""
    lines = [line for subject in subjects for line in _lines(subject)]
    known = [each for each in offsets if each.source != NOTHING]
    if known:
        lines += ["", *offset_lines(known)]
        lines += [STILL_IN] * any(each.source == STROKES for each in known)
    return "\n".join([*lines, "", _summary(subjects)]) + "\n"


def _lines(subject: Inspected) -> list[str]:
    friction = "".join(
        f"; {each.text}" for each in subject.findings if (each.check, each.outcome) == ("friction", "ok")
    )
    odd = [each for each in worst_first(subject.findings) if each.outcome != "ok"]
    width = max((len(each.check) for each in odd), default=0)
    return [
        f"{subject.title}: {VERDICTS[subject.outcome]}{friction}",
        *(f"  {each.outcome:<8}  {each.check:<{width}}  {each.text}" for each in odd),
    ]


def _summary(subjects: Sequence[Inspected]) -> str:
    counts = count_outcomes(subjects)
    total = sum(counts.values())
    shown = ", ".join(f"{counts[outcome]} {outcome}" for outcome in OUTCOMES if counts[outcome])
    return counted(total, "file") + (f": {shown}" if shown else "")
