import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.timestamps import (
    even_rate,
    printed_resolution,
    stamps_to_seconds,
    whole_hertz,
)

RNG = np.random.default_rng(0)
ROWS = np.arange(5000)


def test_numbers_pass_as_they_are() -> None:
    stamps = np.array([3.0, np.nan, 1.5])
    assert stamps_to_seconds(stamps) is stamps or np.shares_memory(stamps_to_seconds(stamps), stamps)
    np.testing.assert_array_equal(stamps_to_seconds(pd.Series([1, 2, 3])), [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("stamps", "origin", "expected"),
    [
        (["NaT", "2024-05-01 12:00:00", "2024-05-01 12:00:00.005", "2024-05-02"], None, [np.nan, 0.0, 0.005, 43200.0]),
        (["2024-05-01 11:59:59.5", "2024-05-01 12:00:01"], "2024-05-01T12:00:00", [-0.5, 1.0]),
        (["2024-05-01 14:00:00+02:00", "2024-05-01 14:00:01+02:00"], "2024-05-01T12:00:00", [0.0, 1.0]),
        (["NaT", "NaT"], None, [np.nan, np.nan]),
    ],
)
def test_dates_become_seconds_from_the_first_stamp_or_the_origin(
    stamps: list[str], origin: str | None, expected: list[float]
) -> None:
    dates = pd.Series(pd.to_datetime(stamps, format="ISO8601"))
    seconds = stamps_to_seconds(dates, None if origin is None else pd.Timestamp(origin))
    np.testing.assert_array_equal(seconds, expected)


@given(st.integers(0, 200 * 365 * 86400 * 10**6))
def test_dates_are_exact_to_a_microsecond(microseconds: int) -> None:
    origin = np.datetime64("1970-01-01", "ns")
    stamp = np.array([origin + np.timedelta64(microseconds, "us")])
    assert abs(stamps_to_seconds(stamp, pd.Timestamp(origin))[0] - microseconds / 1e6) < 1e-6


def test_text_is_no_time() -> None:
    with pytest.raises(RecordingError, match=r"time stamps are of type .* \(first: 'noon'\), expected numbers or"):
        stamps_to_seconds(pd.Series(["noon", "1.0"]))


@pytest.mark.parametrize(
    ("rate_hz", "uncertainty", "expected"),
    [
        (200.003, 0.0, 200.0),
        (199.981, 0.0, 200.0),
        (200.03, 0.0, 200.03),
        (66.667, 0.0, 66.667),
        (599.9, 3e-4, 600.0),
        (60.7, 0.5, 60.7),
    ],
)
def test_whole_hertz(rate_hz: float, uncertainty: float, expected: float) -> None:
    assert whole_hertz(rate_hz, uncertainty) == expected


@pytest.mark.parametrize(
    ("stamps", "resolution_s"),
    [
        ([0.0, 3.0, 4.0], 1.0),
        ([0.0, 0.1, 0.3], 0.1),
        ([1.7e9, 1.7e9 + 0.005], 1e-3),
        ([0.0, 0.015625, 0.03125], 1e-6),
        ([0.0, np.pi], 0.0),
        ([0.0123456789, 0.0173456789], 1e-3),
    ],
)
def test_printed_resolution(stamps: list[float], resolution_s: float) -> None:
    assert printed_resolution(np.array(stamps)) == pytest.approx(resolution_s)


EVEN = {
    "exact": (0.005 * ROWS, 200.0),
    "far from zero": (1e6 + 0.005 * ROWS, 200.0),
    "slightly fast": (ROWS / 200.003, 200.003),
    "printed in milliseconds": (np.round(ROWS / 300.0, 3), 300.0),
    "printed coarser than half a step": (np.round(ROWS / 600.0, 3), 600.0),
    "jitter of 1 %": (0.005 * ROWS + RNG.uniform(-5e-5, 5e-5, len(ROWS)), 200.0),
    "drift of 100 parts in a million": (0.005 * ROWS * (1.0 + 1e-4 * ROWS / len(ROWS)), 200.0),
}


@pytest.mark.parametrize("name", EVEN)
def test_even_stamps(name: str) -> None:
    time_s, rate_hz = EVEN[name]
    assert even_rate(time_s, 0.02) == pytest.approx(rate_hz, rel=2e-4)


def _changed(row: int, stamp_s: float) -> np.ndarray:
    time_s = 0.005 * ROWS
    time_s[row] = stamp_s
    return time_s


UNEVEN = {
    "one sample lost": np.delete(0.005 * ROWS, 3000),
    "one sample lost at the resolution of the stamps": np.delete(np.round(0.01 * ROWS, 2), 3000),
    "one sample lost from stamps in milliseconds": np.delete(np.round(ROWS / 300.0, 3), 3000),
    "second sample lost": np.delete(0.005 * ROWS, 1),
    "one stamp late": _changed(77, 77.3 * 0.005),
    "one stamp missing": _changed(77, np.nan),
    "last stamp missing": _changed(-1, np.nan),
    "one stamp twice": _changed(77, 76 * 0.005),
    "jitter of 20 %": 0.005 * ROWS + RNG.uniform(-5e-4, 5e-4, len(ROWS)),
    "another rate half way": np.where(ROWS < 2500, 0.005 * ROWS, 12.5 + 0.0051 * (ROWS - 2500)),
    "backwards": -0.005 * ROWS,
    "standing": np.zeros(len(ROWS)),
    "random steps of 10 and 11 ms": np.cumsum(RNG.choice([0.010, 0.011], len(ROWS))),
    "two rows": np.array([0.0, 0.005]),
}


@pytest.mark.parametrize("name", UNEVEN)
def test_uneven_stamps(name: str) -> None:
    assert even_rate(UNEVEN[name], 0.02) is None
