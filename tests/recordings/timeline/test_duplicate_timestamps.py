from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.clock_order import OrderedStamps
from cylinder_friction.recordings.timeline.duplicate_timestamps import resolve_repeats
from cylinder_friction.recordings.timeline.time_rules import TimeRules

ROWS = 2000
NOISE = np.random.default_rng(0).normal(size=ROWS)


def resolved(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    rows = np.arange(len(time_s))
    stamps = OrderedStamps(time_s, rows, np.zeros_like(rows), ())
    return resolve_repeats(stamps, [values], TimeRules())


def test_without_repeats_stamps_are_returned_as_they_are() -> None:
    time_s = 0.005 * np.arange(ROWS)
    result_s, keep, repairs = resolved(time_s, NOISE)
    assert result_s is time_s
    assert keep.all()
    assert repairs == []


def test_copies_of_a_row_are_left_out_however_many() -> None:
    result_s, keep, repairs = resolved(np.repeat(0.005 * np.arange(ROWS), 2), np.repeat(NOISE, 2))
    np.testing.assert_array_equal(result_s[keep], 0.005 * np.arange(ROWS))
    assert repairs == [f"{ROWS} rows with stamp and values of the row before left out (first: row 2)"]


def test_a_copied_row_with_a_missing_value_is_a_copy() -> None:
    time_s, values = np.insert(0.005 * np.arange(ROWS), 9, 0.04), np.insert(NOISE, 9, np.nan)
    values[8] = np.nan
    assert resolved(time_s, values)[2] == ["1 row with stamp and values of the row before left out (first: row 10)"]


def test_the_first_of_two_rows_with_one_stamp_stays() -> None:
    result_s, keep, repairs = resolved(
        np.insert(0.005 * np.arange(ROWS), [5, 5], 0.02), np.insert(NOISE, [5, 5], [8, 9])
    )
    np.testing.assert_array_equal(np.flatnonzero(~keep), [5, 6])
    np.testing.assert_array_equal(result_s[keep], 0.005 * np.arange(ROWS))
    assert repairs == ["2 rows with the stamp of the row before but other values left out (first: row 6)"]


@pytest.mark.parametrize(
    ("rate_hz", "tick_s"),
    [(200.0, 0.010), (200.0, 0.015625), (200.0, 0.1), (1000.0, 0.1), (210.0, 0.010), (97.3, 0.05)],
)
def test_a_coarse_clock_is_spread_evenly(rate_hz: float, tick_s: float) -> None:
    true_s = np.arange(ROWS) / rate_hz
    stamps_s = np.floor(true_s / tick_s + 1e-9) * tick_s
    result_s, keep, repairs = resolved(stamps_s, NOISE)
    assert keep.all()
    np.testing.assert_allclose(np.diff(result_s), 1.0 / rate_hz, rtol=2e-4)
    assert np.abs(result_s - true_s).max() < 1.5 / rate_hz
    assert (result_s >= stamps_s - 1e-9).all()
    assert "spread evenly at" in repairs[0]


def test_the_repair_says_how_coarse() -> None:
    _, _, repairs = resolved(np.floor(np.arange(ROWS) / 4) * 0.02, NOISE)
    assert repairs == [
        "coarse stamps, 1500 of 2000 rows with the stamp of the row before (a new stamp every 20 ms), spread evenly at "
        "200 Hz"
    ]


def test_a_constant_channel_does_not_make_a_coarse_clock_a_row_of_copies() -> None:
    _, keep, _ = resolved(np.floor(np.arange(ROWS) / 4) * 0.02, np.ones(ROWS))
    assert keep.all()


def test_a_gap_of_a_coarse_clock_stays_a_gap() -> None:
    stamps_s = np.floor(np.arange(ROWS) / 4) * 0.02
    stamps_s[1000:] += 3.0
    steps_s = np.diff(resolved(stamps_s, NOISE)[0])
    np.testing.assert_allclose(np.delete(steps_s, 999), 0.005, rtol=1e-9)
    assert steps_s[999] == pytest.approx(3.005)


@pytest.mark.parametrize(
    ("time_s", "message"),
    [
        (np.floor(np.arange(ROWS) / 500.0), "time_s has 4 different stamps for 2000 rows, too few to spread"),
        (
            np.sort(np.random.default_rng(1).integers(0, 1000, ROWS)) * 0.01,
            "different stamps for 2000 rows, and the rows were not sampled evenly: the stamp .* s is .* ms off an even",
        ),
    ],
)
def test_rows_that_were_not_sampled_evenly_are_refused(time_s: np.ndarray, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        resolved(time_s, NOISE)
