"""Which recordings of many are drawn, and whose signals are held until then."""

from collections.abc import Iterable, Sequence
from itertools import groupby

from cylinder_friction.reporting.inspection.subject import Inspected, worst

PLOTTED = 12
"""How many files are drawn on one page; the others stand in the table."""

PIECES = 48
"""And how many recordings at most, where gaps split files into pieces."""


def held(subjects: Iterable[Inspected], plotted: int = PLOTTED) -> list[Inspected]:
    """Return the subjects with the signals of those alone that a page may draw, so that memory stays bounded.

    Args:
        subjects: The pieces of one file behind each other; consumed one file at a time.
        plotted: As for ``chosen``.
    """
    kept: list[Inspected] = []
    count = {True: 0, False: 0}
    for _, group in groupby(subjects, key=lambda subject: subject.file):
        pieces = list(group)
        refused = _refused(pieces)
        drawable = any(piece.recording is not None for piece in pieces)
        hold = drawable and count[refused] < plotted
        count[refused] += hold
        kept += [piece if hold and number < PIECES else piece.without_signals() for number, piece in enumerate(pieces)]
    return kept


def chosen(subjects: Sequence[Inspected], plotted: int = PLOTTED) -> list[int]:
    """Return the places of the subjects to draw, in order: of every chosen file all pieces.

    Refused files come first, for what is wrong wants to be seen, but leave half the places to the others.
    """
    files: dict[str, list[int]] = {}
    for place, subject in enumerate(subjects):
        files.setdefault(subject.file, []).append(place)
    drawable = {
        file: [place for place in places if subjects[place].recording is not None] for file, places in files.items()
    }
    refused = [
        file for file, places in files.items() if drawable[file] and _refused([subjects[place] for place in places])
    ]
    others = [file for file in files if drawable[file] and file not in refused]
    first = max(plotted - len(others), plotted // 2)
    taken = refused[:first]
    taken += others[: plotted - len(taken)]
    places = sorted(place for file in taken for place in drawable[file])
    return places[:PIECES]


def _refused(pieces: Sequence[Inspected]) -> bool:
    return worst(piece.outcome for piece in pieces) == "refused"
