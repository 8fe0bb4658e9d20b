import re
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.channel_timelines import OrderedStamps, order_stamps, resolve_duplicates
from cylinder_friction.recordings.timeline.timestamps import TimeRules

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


@pytest.mark.parametrize(("by_s", "hour"), [(3600.0, ", an hour back: the end of summer time"), (7200.0, ")")])
def test_a_clock_set_back_by_an_hour_is_named(by_s: float, hour: str) -> None:
    (repair,) = order_stamps(back(200, by_s)(good()), np.zeros(ROWS, dtype=np.bool_)).repairs
    assert repair.startswith(f"split at 1 restart of the clock (first: row 201, from 0.995 to {1.0 - by_s:g} s{hour}")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda time_s: time_s[:2], "has 2 rows, expected at least 3"),
        (np.zeros_like, "time_s stands at 0 s in all 400 rows, expected increasing time"),
        (lambda time_s: -time_s, "time_s runs backwards from row to row in all 400 rows, expected increasing time"),
        (stamps(dict.fromkeys(range(30, 60), np.nan)), "time_s is not a number, or beyond 1e+11 s, in 30 of 400"),
        (lambda time_s: time_s + 20260314081500.0, "at most 5 %; write a date such as 20260314081500.005 as 2026-03-"),
        (lambda time_s: np.random.default_rng(0).permutation(time_s), "time_s goes back in row "),
        (rows(1, 0), "goes back in row 102, from 0.505 to 0.5 s, and does not run on from there: rows are swapped, or"),
        (lambda time_s: np.r_[time_s[:-2], time_s[[-1, -2]]], "goes back in row 400, from 1.995 to 1.99 s"),
        (stamps({50: 9e9, 51: 9e9}), "goes back in row 53, from 9e+09 to 0.26 s"),
        (back(150, 0.0062), "goes back in row 151, from 0.745 to 0.7438 s"),
    ],
)
def test_stamps_beyond_repair_are_refused(damage: Damage, message: str) -> None:
    time_s = damage(good())
    with pytest.raises(RecordingError, match=re.escape(message)):
        order_stamps(time_s, np.zeros(len(time_s), dtype=np.bool_))


COARSE_ROWS = 2000
EVEN_S = 0.005 * np.arange(COARSE_ROWS)
NOISE = np.random.default_rng(0).normal(size=COARSE_ROWS)


def resolved(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    rows = np.arange(len(time_s))
    stamps = OrderedStamps(time_s, rows, np.zeros_like(rows), ())
    return resolve_duplicates(stamps, [values], TimeRules())


COPIED = "the stamp of the row before left out (first: row"
HOLES = np.insert(NOISE, 9, np.nan)
HOLES[8] = np.nan


@pytest.mark.parametrize(
    ("time_s", "values", "repair"),
    [
        (np.repeat(EVEN_S, 2), np.repeat(NOISE, 2), f"{COARSE_ROWS} rows with {COPIED} 2)"),
        (np.insert(EVEN_S, 9, 0.04), HOLES, f"1 row with {COPIED} 10)"),
        (
            np.insert(EVEN_S, [5, 5], 0.02),
            np.insert(NOISE, [5, 5], [8, 9]),
            "2 rows with the stamp of the row before left out (first: row 6, 2 of them with other values)",
        ),
    ],
    ids=["each row twice", "a missing value twice", "other values"],
)
def test_the_first_of_rows_with_one_stamp_stays(time_s: np.ndarray, values: np.ndarray, repair: str) -> None:
    result_s, keep, repairs = resolved(time_s, values)
    np.testing.assert_array_equal(result_s[keep], EVEN_S)
    assert repairs == [repair]


@pytest.mark.parametrize(("rate_hz", "tick_s"), [(200, 0.015625), (1000, 0.1), (210, 0.01), (97.3, 0.05), (200, 1.0)])
def test_a_coarse_clock_is_spread_evenly(rate_hz: float, tick_s: float) -> None:
    true_s = 0.635 + np.arange(COARSE_ROWS) / rate_hz
    stamps_s = np.floor(true_s / tick_s + 1e-9) * tick_s
    result_s, keep, repairs = resolved(stamps_s, NOISE)
    assert keep.all()
    assert resolved(stamps_s, np.ones(COARSE_ROWS))[1].all()  # rows of a constant channel are no copies
    np.testing.assert_allclose(np.diff(result_s), 1.0 / rate_hz, rtol=2e-4)
    assert np.abs(result_s - true_s).max() < 1.5 / rate_hz
    assert (result_s >= stamps_s - 1e-9).all()
    assert re.match(r"coarse stamps, \d+ of 2000 rows .* \(a new stamp every \S+ ms\), spread evenly", repairs[0])


def test_a_gap_of_a_coarse_clock_stays_a_gap() -> None:
    stamps_s = np.floor(np.arange(COARSE_ROWS) / 4) * 0.02
    stamps_s[1000:] += 3.0
    steps_s = np.diff(resolved(stamps_s, NOISE)[0])
    np.testing.assert_allclose(np.delete(steps_s, 999), 0.005, rtol=1e-9)
    assert steps_s[999] == pytest.approx(3.005)


@pytest.mark.parametrize(
    ("time_s", "message"),
    [
        (np.floor(np.arange(COARSE_ROWS) / 500.0), "time_s has 4 different stamps for 2000 rows, too few to spread"),
        (np.sort(np.random.default_rng(1).integers(0, 1000, COARSE_ROWS)) * 0.01, "different stamps for 2000 rows,"),
        (np.floor(np.delete(np.arange(COARSE_ROWS + 50), range(710, 760)) / 100.0), r"7 s \(from row 701 on\) has 50 "),
    ],
)
def test_rows_that_were_not_sampled_evenly_are_refused(time_s: np.ndarray, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        resolved(time_s, NOISE)
