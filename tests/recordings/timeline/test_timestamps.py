import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.timestamps import even_rate, stamps_to_seconds

RNG = np.random.default_rng(0)
ROWS = np.arange(5000)


@pytest.mark.parametrize(
    ("stamps", "origin", "expected"),
    [
        (["NaT", "2024-05-01 12:00:00", "2024-05-01 12:00:00.005", "2024-05-02"], None, [np.nan, 0.0, 0.005, 43200.0]),
        (["2024-05-01 11:59:59.5", "2024-05-01 12:00:01"], "2024-05-01T12:00:00", [-0.5, 1.0]),
        (["2024-05-01 14:00:00+02:00", "2024-05-01 14:00:01+02:00"], "2024-05-01T12:00:00", [0.0, 1.0]),
        (["NaT", "NaT"], None, [np.nan, np.nan]),
    ],
)
def test_dates_become_seconds_from_an_origin(stamps: list[str], origin: str | None, expected: list[float]) -> None:
    dates = pd.Series(pd.to_datetime(stamps, format="ISO8601"))
    seconds = stamps_to_seconds(dates, None if origin is None else pd.Timestamp(origin))
    np.testing.assert_array_equal(seconds, expected)


def test_text_is_no_time() -> None:
    with pytest.raises(RecordingError, match=r"time stamps are of type .* \(first: 'noon'\), expected numbers or"):
        stamps_to_seconds(pd.Series(["noon", "1.0"]))


STAMPS: dict[str, tuple[np.ndarray, float | None]] = {
    "far from zero": (1e6 + 0.005 * ROWS, 200.0),
    "printed in milliseconds": (np.round(ROWS / 300.0, 3), 300.0),
    "printed coarser than half a step": (np.round(ROWS / 600.0, 3), 600.0),
    "jitter of 1 %": (0.005 * ROWS + RNG.uniform(-5e-5, 5e-5, len(ROWS)), 200.0),
    "drift of 100 parts in a million": (0.005 * ROWS * (1.0 + 1e-4 * ROWS / len(ROWS)), 200.0),
    "one sample lost": (np.delete(0.005 * ROWS, 3000), None),
    "one sample lost at the resolution of the stamps": (np.delete(np.round(0.01 * ROWS, 2), 3000), None),
    "one stamp late": (0.005 * ROWS + 0.0015 * (ROWS == 77), None),
    "another rate half way": (np.where(ROWS < 2500, 0.005 * ROWS, 12.5 + 0.0051 * (ROWS - 2500)), None),
    "another rate from a block on": (np.where(ROWS < 3072, 0.005 * ROWS, 15.36 + 0.00502 * (ROWS - 3072)), None),
    "backwards": (-0.005 * ROWS, None),
}


@pytest.mark.parametrize("name", STAMPS)
def test_stamps_are_even_or_not(name: str) -> None:
    time_s, rate_hz = STAMPS[name]
    assert even_rate(time_s) == (rate_hz and pytest.approx(rate_hz, rel=2e-4))
