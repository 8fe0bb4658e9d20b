"""The order of samples follows from their indices, whatever order they come in."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.service.live.session import SamplePiece, SessionOrder
from cylinder_friction.service.live.settings import SessionRules

RULES = SessionRules(hold_s=1.0, hold_rows=100, short_gap_s=0.05)


def rows(begin: int, end: int) -> np.ndarray:
    """Samples whose one number is their index."""
    return np.arange(begin, end, dtype=np.float64)[:, None]


def order(next_index: int | None = 0) -> SessionOrder:
    return SessionOrder(0.01, 1, RULES, next_index)


def stepped(pieces: list[SamplePiece]) -> list[float]:
    return [value for piece in pieces for value in piece.samples[:, 0].tolist()]


def take(session: SessionOrder, begin: int, end: int, now_s: float = 0.0) -> list[SamplePiece]:
    return session.receive(begin, 0.01 * begin, rows(begin, end), now_s)


def test_a_short_gap_becomes_no_numbers_once_it_was_waited_for() -> None:
    session = order()
    take(session, 0, 2)
    assert take(session, 5, 6, now_s=0.0) == []
    assert session.overdue(0.9) == []
    gap, after = session.overdue(1.0)
    assert (gap.index, len(gap.samples), gap.reset) == (2, 3, False)
    assert np.isnan(gap.samples).all()
    assert abs(gap.time_s - 0.02) < 1e-12
    assert (after.index, after.reset) == (5, False)
    assert session.counts.missing == 3


def test_a_long_gap_begins_anew_at_the_stated_index() -> None:
    session = order()
    take(session, 0, 2)
    take(session, 8, 9, now_s=0.0)
    (after,) = session.overdue(2.0)
    assert (after.index, after.reset) == (8, True)
    assert (session.counts.skipped, session.counts.resets, session.next_index) == (6, 1, 9)


def test_too_many_that_wait_do_not_wait_longer() -> None:
    session = order()
    assert take(session, 10, 60) == []
    assert len(take(session, 60, 120)) == 2
    assert session.held_rows == 0


def test_the_first_sample_states_where_a_new_session_begins() -> None:
    session = order(None)
    assert stepped(take(session, 1000, 1002)) == [1000, 1001]


@given(st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30), st.floats(0.0, 0.6)), min_size=1, max_size=30))
def test_blocks_that_overlap_in_any_way_step_each_sample_once_and_count_each(
    blocks: list[tuple[int, int, float]],
) -> None:
    session, now_s, pieces = order(), 0.0, []
    for begin, length, pause_s in blocks:
        now_s += pause_s
        pieces += take(session, begin, begin + length, now_s) + session.overdue(now_s)
    pieces += session.overdue(now_s + 10.0)
    given_values = [value for value in stepped(pieces) if value == value]
    assert given_values == sorted(set(given_values))
    assert [piece.index for piece in pieces if piece.samples[0, 0] == piece.samples[0, 0]] == [
        piece.samples[0, 0] for piece in pieces if piece.samples[0, 0] == piece.samples[0, 0]
    ]
    counts = session.counts
    assert counts.stepped + counts.duplicate + counts.late == sum(length for _, length, _ in blocks)
    assert counts.stepped == len(given_values)
    assert sum(len(piece.samples) for piece in session.late) == counts.late


def test_late_samples_are_kept_once_each_and_never_stepped() -> None:
    session = order()
    take(session, 0, 2)
    take(session, 20, 22)
    session.overdue(1.0)  # samples 2 to 19 are given up
    assert take(session, 1, 6) == []
    assert take(session, 4, 8) == []
    assert [(piece.index, len(piece.samples)) for piece in session.late] == [(2, 4), (6, 2)]
    assert (session.counts.late, session.counts.duplicate) == (6, 3)
