"""Which recordings are drawn, and whose signals stay in memory."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.reporting.inspection.choice import PIECES, chosen, held
from cylinder_friction.reporting.inspection.subject import Inspected
from cylinder_friction.reporting.inspection.text import text_report

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording

OK, BAD = Finding("rate", "ok", "200 Hz"), Finding("motion", "refused", "does not move")


def subjects(recording: Recording, outcomes: str) -> list[Inspected]:
    """Return a file a letter: g is good, b refused with a recording, u unreadable."""
    return [
        Inspected(f"{number}.csv", [OK if letter == "g" else BAD], None if letter == "u" else recording)
        for number, letter in enumerate(outcomes)
    ]


@pytest.mark.parametrize(
    ("outcomes", "plotted", "places"),
    [
        ("ggg", 12, [0, 1, 2]),
        ("gggggg", 4, [0, 1, 2, 3]),
        ("ggggggb", 4, [0, 1, 2, 6]),
        ("ggggbbb", 4, [0, 1, 4, 5]),
        ("bbbbbb", 4, [0, 1, 2, 3]),
        ("bbbbbg", 4, [0, 1, 2, 5]),
        ("uubgu", 4, [2, 3]),
        ("", 4, []),
    ],
)
def test_refused_files_come_first_and_leave_half_to_the_others(
    strokes: Recording, outcomes: str, plotted: int, places: list[int]
) -> None:
    found = subjects(strokes, outcomes)
    assert chosen(found, plotted) == places
    assert chosen(held(found, plotted), plotted) == places


def test_a_file_in_pieces_is_shown_whole(strokes: Recording) -> None:
    pieces = [Inspected("a.csv", [OK], strokes) for _ in range(5)]
    assert chosen([*pieces, *subjects(strokes, "gg")], 2) == [0, 1, 2, 3, 4, 5]


def test_a_file_in_hundreds_of_pieces_is_not(strokes: Recording) -> None:
    pieces = held(Inspected("a.csv", [OK], strokes) for _ in range(PIECES + 100))
    assert len(chosen(pieces)) == PIECES
    assert sum(piece.recording is not None for piece in pieces) == PIECES


def test_what_is_not_held_is_reported_like_what_is(strokes: Recording) -> None:
    repaired = replace(strokes, metadata=replace(strokes.metadata, repairs=("2 samples filled",)))
    found = [*subjects(strokes, "gbgbu"), Inspected("r.csv", [OK], repaired)]
    kept = held(found, plotted=1)
    assert [subject.recording is not None for subject in kept] == [True, True, False, False, False, False]
    assert text_report(kept) == text_report(found)
    assert [subject.outcome for subject in kept] == [subject.outcome for subject in found]
