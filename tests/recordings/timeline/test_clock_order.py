from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.clock_order import order_stamps
from cylinder_friction.recordings.timeline.time_rules import TimeRules

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Stamps = NDArray[np.float64]
    Damage = Callable[[Stamps], Stamps]

ROWS = 400


def good() -> Stamps:
    return 0.005 * np.arange(ROWS)


def stamps(changes: dict[int, float]) -> Damage:
    def change(time_s: Stamps) -> Stamps:
        for row, stamp_s in changes.items():
            time_s[row] = stamp_s
        return time_s

    return change


def rows(*order: int) -> Damage:
    """Put rows from 100 on into another order."""

    def change(time_s: Stamps) -> Stamps:
        time_s[100 : 100 + len(order)] = time_s[100 + np.array(order)]
        return time_s

    return change


def back(row: int, by_s: float) -> Damage:
    return lambda time_s: np.where(np.arange(ROWS) < row, time_s, time_s - by_s)


CASES = {
    "nothing": (lambda time_s: time_s, ROWS, 1, []),
    "no stamp": (stamps({7: np.nan, 9: np.inf}), ROWS - 2, 1, ["2 rows without a time stamp left out (first: row 8)"]),
    "two rows swapped": (rows(1, 0), ROWS, 1, ["2 rows out of order sorted (first: row 101)"]),
    "one row late": (rows(1, 2, 3, 4, 0), ROWS, 1, ["5 rows out of order sorted (first: row 101)"]),
    "two blocks swapped": (
        rows(*range(8, 16), *range(8)),
        ROWS,
        1,
        ["16 rows out of order sorted (first: row 101)"],
    ),
    "first rows swapped": (
        lambda time_s: np.concatenate([time_s[[1, 0]], time_s[2:]]),
        ROWS,
        1,
        ["2 rows out of order sorted (first: row 1)"],
    ),
    "last rows swapped": (
        lambda time_s: np.concatenate([time_s[:-2], time_s[[-1, -2]]]),
        ROWS,
        1,
        [f"2 rows out of order sorted (first: row {ROWS - 1})"],
    ),
    "a zero": (
        stamps({50: 0.0}),
        ROWS - 1,
        1,
        ["1 row with a stamp that fits neither neighbour left out (first: row 51)"],
    ),
    "far ahead": (
        stamps({50: 9e9, 51: 9e9}),
        ROWS - 2,
        1,
        ["2 rows with a stamp that fits neither neighbour left out (first: row 51)"],
    ),
    "first far ahead": (
        stamps({0: 9e9}),
        ROWS - 1,
        1,
        ["1 row with a stamp that fits neither neighbour left out (first: row 1)"],
    ),
    "last zero": (
        stamps({-1: 0.0}),
        ROWS - 1,
        1,
        [f"1 row with a stamp that fits neither neighbour left out (first: row {ROWS})"],
    ),
    "logger restarted": (
        back(150, 150 * 0.005),
        ROWS,
        2,
        ["split at 1 restart of the clock (first: row 151, from 0.745 to 0 s)"],
    ),
    "counter rolls over": (
        lambda time_s: np.mod(time_s, 0.64),
        ROWS,
        4,
        ["split at 3 restarts of the clock (first: row 129, from 0.635 to 0 s)"],
    ),
    "clock set back by a little": (
        back(150, 0.05),
        ROWS,
        2,
        ["split at 1 restart of the clock (first: row 151, from 0.745 to 0.7 s)"],
    ),
    "clock set back by part of a step": (
        back(150, 0.0062),
        ROWS,
        2,
        ["split at 1 restart of the clock (first: row 151, from 0.745 to 0.7438 s)"],
    ),
    "swapped, then restarted": (
        lambda time_s: back(150, 0.75)(rows(1, 0)(time_s)),
        ROWS,
        2,
        [
            "2 rows out of order sorted (first: row 101)",
            "split at 1 restart of the clock (first: row 151, from 0.745 to 0 s)",
        ],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_damaged_order(name: str) -> None:
    damage, kept, segments, repairs = CASES[name]
    logged = damage(good())
    ordered = order_stamps(logged, np.zeros(ROWS, dtype=np.bool_), TimeRules())
    assert list(ordered.repairs) == repairs
    assert len(ordered.time_s) == kept
    assert ordered.segments[-1] + 1 == segments
    within = np.diff(ordered.segments) == 0
    assert (np.diff(ordered.time_s)[within] > 0.0).all()
    np.testing.assert_array_equal(ordered.time_s, logged[ordered.rows])


def test_rows_with_neither_stamp_nor_value_are_no_rows() -> None:
    time_s = good()
    time_s[200:] = np.nan
    ordered = order_stamps(time_s, np.isnan(time_s), TimeRules())
    assert (len(ordered.time_s), ordered.repairs) == (200, ())


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda time_s: time_s[:2], "has 2 rows, expected at least 3"),
        (
            lambda time_s: np.full_like(time_s[:3], np.nan),
            "time_s is not a number, or beyond 1e+15 s, in 3 of 3 rows (first: row 1)",
        ),
        (np.zeros_like, "time_s stands at 0 s in all 400 rows, expected increasing time"),
        (lambda time_s: -time_s, "time_s runs backwards from row to row in all 400 rows, expected increasing time"),
        (
            stamps(dict.fromkeys(range(30, 60), np.nan)),
            "time_s is not a number, or beyond 1e+15 s, in 30 of 400 rows (first: row 31), expected at most 5 %; check",
        ),
        (
            lambda time_s: np.random.default_rng(0).permutation(time_s),
            "of 400 rows (here from",
        ),
        (
            lambda time_s: np.mod(time_s, 0.05),
            "time_s runs backwards or jumps in 21 or more of 400 rows (here from 0.05 to 0.005 s), expected at most 20",
        ),
    ],
)
def test_stamps_beyond_repair_are_refused(damage: Damage, message: str) -> None:
    time_s = damage(good())
    with pytest.raises(RecordingError, match=re.escape(message)):
        order_stamps(time_s, np.zeros(len(time_s), dtype=np.bool_), TimeRules())
