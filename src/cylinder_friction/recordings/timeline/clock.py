"""What a logger's time stamps say: seconds, how finely they are printed, and whether they run evenly."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numba
import numpy as np
import pandas as pd

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Indices = NDArray[np.int64]

BLOCK = 1024
"""Samples over which a clock must follow a straight line; a drift over more than that is a matter of its rate."""

RATE_DRIFT = 1e-3
"""How far the rate of a block may be from the rate of the whole: a velocity would be wrong by as much."""

WHOLE_HERTZ = 1e-4
"""A rate this close to a whole number of hertz is that number: clocks are off by some parts in a million."""

LATEST_S = 1e15
"""A stamp beyond this, thirty million years, is no time: nanoseconds since 1970 taken for seconds are 1.7e18."""

USUAL_STEP_SHARE = 0.9
"""If one step is commoner than this, the stamps are exact, and other steps are lost samples, not rounding."""


def stamps_to_seconds(stamps: pd.Series[Any] | NDArray[Any], origin: np.datetime64 | None = None) -> Array:
    """Return time stamps in seconds, shape ``(n,)``; a stamp that is missing (NaT) is NaN.

    Args:
        stamps: Numbers in seconds, which pass as they are, or dates (``datetime64``, with or without time zone).
        origin: The date that is 0 s, in UTC where the stamps know their time zone; None for the first stamp. Tables of
            one file share an origin. Exact to better than 1 µs over 200 years.

    Raises:
        RecordingError: The stamps are neither numbers nor dates.
    """
    series = pd.Series(stamps, copy=False)
    if isinstance(series.dtype, pd.DatetimeTZDtype):
        series = series.dt.tz_convert("UTC").dt.tz_localize(None)
    if pd.api.types.is_datetime64_any_dtype(series.dtype):
        return _seconds_from(series.to_numpy(dtype="datetime64[ns]"), origin)
    if not pd.api.types.is_numeric_dtype(series.dtype):
        raise RecordingError(
            f"time stamps are of type {series.dtype} (first: {series.iloc[0] if len(series) else None!r}), expected "
            "numbers or dates; check the time channel and its unit or date format in the mapping"
        )
    return series.to_numpy(dtype=np.float64, na_value=np.nan)


def _seconds_from(dates: NDArray[np.datetime64], origin: np.datetime64 | None) -> Array:
    missing = np.isnat(dates)
    if missing.all():
        return np.full(len(dates), np.nan)
    start = dates[~missing][0] if origin is None else origin.astype("datetime64[ns]")
    # The difference is taken in whole nanoseconds: 1.7e9 s since 1970 as a float would be good to 0.2 µs only.
    seconds: Array = (dates - start).astype(np.int64) / 1e9
    seconds[missing] = np.nan
    return seconds


def whole_hertz(rate_hz: float, uncertainty: float = 0.0) -> float:
    """Return the rate; a whole number of hertz if it is within 1e-4 of one.

    Args:
        rate_hz: As the stamps have it [Hz].
        uncertainty: Of that rate, as a share; more than 1e-4 in a short log with coarse stamps. At most 1e-3 counts.
    """
    whole = float(round(rate_hz))
    return whole if abs(rate_hz - whole) <= max(WHOLE_HERTZ, min(uncertainty, 1e-3)) * rate_hz else rate_hz


def even_rate(time_s: Array, jitter_share: float) -> float | None:
    """Return the mean rate [Hz] of stamps that run evenly, each a sample later than the one before; else None.

    Even means: within every 1024 samples the stamps are off a straight line by no more than ``jitter_share`` of a
    step, or than their printed resolution explains, and the rate stays the same within 1e-3. A clock that is fast,
    slow or drifts by some parts in a million is even. A lost sample moves the line by half a step, so it is not.

    Args:
        time_s: Stamps, shape ``(n,)`` [s]; one that is not finite makes them uneven.
        jitter_share: Allowed deviation as a share of the step.
    """
    if len(time_s) < 3 or not (abs(time_s[0]) < LATEST_S and abs(time_s[-1]) < LATEST_S):
        return None
    step_s = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    if step_s <= 0.0:
        return None
    if _follows_lines(time_s, step_s, jitter_share * step_s, BLOCK):
        return 1.0 / step_s
    resolution_s = explaining_resolution(time_s, step_s)
    if resolution_s > jitter_share * step_s and _follows_lines(time_s, step_s, 1.05 * resolution_s, BLOCK):
        return whole_hertz(1.0 / step_s, resolution_s / (time_s[-1] - time_s[0]))
    return None


def explaining_resolution(time_s: Array, step_s: float) -> float:
    """Return the printed resolution [s] if it may explain uneven steps, else 0.

    It may if it is well below a step (300 Hz printed in milliseconds: 3, 3, 4 ms), or if it is up to one step and no
    step is the usual one (600 Hz in milliseconds: 1, 2, 2 ms). Stamps at every 10 ms with one step of 20 ms have
    lost a sample.
    """
    if not np.isfinite(time_s).all():
        return 0.0
    resolution_s = printed_resolution(time_s)
    if resolution_s <= 0.4001 * step_s:
        return resolution_s
    if resolution_s > step_s:
        return 0.0
    multiples = np.rint(np.diff(time_s) / resolution_s).astype(np.int64)
    _, counts = np.unique(multiples, return_counts=True)
    return resolution_s if counts.max() < USUAL_STEP_SHARE * len(multiples) else 0.0


def printed_resolution(time_s: Array) -> float:
    """Return the power of ten [s], 1 s to 1 µs, that finite stamps run in multiples of; 0 if they are finer."""
    rounding = 4.0 * np.finfo(np.float64).eps * float(max(time_s.max(), -time_s.min()))
    for digits in range(7):
        tolerance = 1e-4 + rounding * 10.0**digits
        if tolerance > 0.1:  # too large a number for that many digits
            break
        if _multiples(time_s, 10.0**digits, tolerance):
            return float(10.0**-digits)
    return 0.0


@numba.njit(cache=True)
def _multiples(time_s: Array, factor: float, tolerance: float) -> bool:
    first_s = time_s[0]
    for stamp_s in time_s:
        number = (stamp_s - first_s) * factor
        if not abs(number - np.rint(number)) <= tolerance:
            return False
    return True


def follows_even_clock(time_s: Array, index: Indices, step_s: float, tolerance_s: float) -> bool:
    """Return whether stamps follow sample numbers on straight lines of 1024 samples, as in ``even_rate``.

    Args:
        time_s: Increasing stamps, shape ``(n,)`` [s].
        index: Sample number of each, shape ``(n,)``, increasing; a number that is missing was lost.
        step_s: Time between two sample numbers, over all [s].
        tolerance_s: Allowed deviation from the line [s].
    """
    return bool(_follows_index(time_s, index, step_s, tolerance_s, BLOCK))


@numba.njit(cache=True)
def _follows_lines(time_s: Array, step_s: float, tolerance_s: float, block: int) -> bool:
    rows = len(time_s)
    start = 0
    while start < rows - 1:
        # A short remainder joins the last block, so that every block is long enough to tell its rate.
        end = start + block if rows - 1 - start >= 2 * block else rows - 1
        slope_s = (time_s[end] - time_s[start]) / (end - start)
        if not abs(slope_s - step_s) <= RATE_DRIFT * step_s + 2.0 * tolerance_s / (end - start):
            return False
        first_s = time_s[start]
        for row in range(start + 1, end + 1):
            off_s = abs(time_s[row] - first_s - (row - start) * slope_s)
            # Written so that NaN, too, is refused.
            if not (off_s <= tolerance_s and time_s[row] > time_s[row - 1]):
                return False
        start = end
    return True


@numba.njit(cache=True)
def _follows_index(time_s: Array, index: Indices, step_s: float, tolerance_s: float, block: int) -> bool:
    rows = len(time_s)
    start = 0
    while start < rows - 1:
        end = start + block if rows - 1 - start >= 2 * block else rows - 1
        samples = index[end] - index[start]
        slope_s = (time_s[end] - time_s[start]) / samples
        if not abs(slope_s - step_s) <= RATE_DRIFT * step_s + 2.0 * tolerance_s / samples:
            return False
        for row in range(start + 1, end + 1):
            off_s = abs(time_s[row] - time_s[start] - (index[row] - index[start]) * slope_s)
            if not off_s <= tolerance_s:
                return False
        start = end
    return True
