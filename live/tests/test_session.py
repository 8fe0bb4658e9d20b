"""The order of samples follows from their indices, whatever order they come in; more of it is in ``test_faults.py``."""

from __future__ import annotations

import numpy as np

from cylinder_friction_live.frames import SampleBlock
from cylinder_friction_live.session import SessionOrder
from cylinder_friction_live.settings import SessionRules

RULES = SessionRules(hold_s=1.0, hold_rows=100, short_gap_s=0.05)


def rows(begin: int, end: int) -> np.ndarray:
    """Samples whose one number is their index."""
    return np.arange(begin, end, dtype=np.float64)[:, None]


def order() -> SessionOrder:
    return SessionOrder(0.01, 1, RULES, 0)


def take(session: SessionOrder, begin: int, end: int, now_s: float = 0.0) -> list[SampleBlock]:
    return session.receive(SampleBlock(0, begin, 0.01 * begin, rows(begin, end)), now_s)


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


def test_late_samples_are_kept_once_each_and_never_stepped() -> None:
    session = order()
    take(session, 0, 2)
    take(session, 20, 22)
    session.overdue(1.0)  # samples 2 to 19 are given up
    assert take(session, 1, 6) == []
    assert take(session, 4, 8) == []
    assert [(piece.index, len(piece.samples)) for piece in session.late] == [(2, 4), (6, 2)]
    assert (session.counts.late, session.counts.duplicate) == (6, 3)
