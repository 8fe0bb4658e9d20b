"""Estimate how late a load cell is compared with the pressures, by its amplifier's filter or its own logger.

While the piston slides in one direction, friction hardly changes. The drive force F then changes at once with the
load L:

    F(t) - F(t - w) = L(t + delay) - L(t + delay - w) + residual

The delay with the least residual over all such rows is found to a fraction of a sample.
"""

import math

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.checks.limits import Finding

WINDOW_S = 0.1  # Window over which changes are computed, w [s]
LONGEST_S = 0.25  # Longest delay, late or early, that is searched for [s]
CLEAR_SHARE = 0.1  # Least change of the load within a window that is used, as a share of the load's range
LEAST_S = 0.5  # Least total duration of rows with such a change [s]
GREATEST_RESIDUAL = 0.5  # Largest share of the variance of the drive force's changes that the load may not explain
SURE = 3.0  # Least delay that is noted, in standard errors
SHORTEST_S = 5e-3  # Least delay that is noted [s]


def check_load_delay(
    drive_n: Array, load_n: Array, rows: NDArray[np.int64], direction: Array, sample_time_s: float
) -> list[Finding]:
    """Note ``load_delay`` if the load cell is clearly late or early.

    Args:
        drive_n: Drive force on the piston, shape ``(n,)`` [N].
        load_n: Reading of the load cell, shape ``(n,)`` [N].
        rows: Indices of evenly chosen rows in which the piston clearly moves, shape ``(m,)``.
        direction: 1 for extending and -1 for retracting in each of these rows, shape ``(m,)``.
        sample_time_s: Time between two samples [s].
    """
    delay = _delay(drive_n, load_n, rows, direction, sample_time_s)
    if delay is None or abs(delay[0]) < max(SHORTEST_S, SURE * delay[1]):
        return []
    late_ms, error_ms = (1e3 * value for value in delay)
    when, which = ("after", "the load cell") if late_ms > 0.0 else ("before", "both pressure sensors")
    text = (
        f"load_force_n comes {abs(late_ms):.1f} ± {error_ms:.1f} ms {when} the pressures; expected both at once, or "
        f"friction is off while the load changes; state sensor.delay_s of {which} in the mapping, {abs(delay[0]):.3f} "
        "s more than it is now"
    )
    return [Finding("load_delay", "noted", text)]


def _delay(
    drive_n: Array, load_n: Array, rows: NDArray[np.int64], direction: Array, sample_time_s: float
) -> tuple[float, float] | None:
    """Estimate how much later than the pressures the load was logged, and the standard error [s].

    Rows within one window count as one. The result is None if the load changes or explains too little.
    """
    window, most = (max(1, round(time_s / sample_time_s)) for time_s in (WINDOW_S, LONGEST_S))
    stride = int(np.diff(rows).min()) if len(rows) > 1 else 1
    # Select rows before which the piston has moved in one direction for a whole window
    began, place, turned = (
        np.searchsorted(rows, rows - window),
        np.arange(len(rows)),
        np.append(0.0, direction).cumsum(),
    )
    sliding = (place - began) * stride >= window - stride
    sliding &= np.abs(turned[place + 1] - turned[began]) == place - began + 1
    rows = rows[sliding & (rows >= window + most) & (rows < len(load_n) - most)]
    lags = np.arange(-most, most + 1)
    changes_n = (load_n[window:] - load_n[:-window])[rows[:, None] - window + lags]
    low, high = np.quantile(load_n, (0.01, 0.99))
    clear = np.abs(changes_n).max(axis=1, initial=0.0) > CLEAR_SHARE * (high - low)
    if clear.sum() * stride * sample_time_s < LEAST_S:
        return None
    changes_n, driven_n = changes_n[clear], (drive_n[rows] - drive_n[rows - window])[clear]
    residual = np.var(driven_n[:, None] - changes_n, axis=0)
    best = int(np.argmin(residual))
    if best in (0, len(lags) - 1) or residual[best] > GREATEST_RESIDUAL * np.var(driven_n):
        return None
    before, here, after = residual[best - 1 : best + 2]
    bend = before - 2.0 * here + after  # of residual = here + bend/2·(lag - best)²
    independent = len(driven_n) * stride / window
    return (
        float(lags[best] + 0.5 * (before - after) / bend) * sample_time_s,
        math.sqrt(2.0 * here / (bend * independent)) * sample_time_s,
    )
