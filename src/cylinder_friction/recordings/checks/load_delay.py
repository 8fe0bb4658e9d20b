"""How late a load cell is beside the pressures: the filter of its amplifier, or a logger of its own, holds it back.

While the piston slides on in one direction, friction hardly changes, so that the drive force F changes with the load L
at once:

    F(t) - F(t - w) = L(t + delay) - L(t + delay - w) + residual

The delay is the one that leaves the least residual over all such rows, to a fraction of a sample.
"""

import math

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.checks.limits import Finding

WINDOW_S = 0.1  # Time over which changes are taken, w [s]
LONGEST_S = 0.25  # Greatest delay, late or early, that is searched [s]
CLEAR_SHARE = 0.1  # The load changes clearly if it changes by this share of its range within a window
LEAST_S = 0.5  # Fewest rows with a clear change, as a duration [s]
GREATEST_RESIDUAL = 0.5  # Share of the drive force's changes, as a variance, that the load may leave unexplained
SURE = 3.0  # A delay is noted from this many standard errors on
SHORTEST_S = 5e-3  # Shortest delay that is noted [s]


def check_load_delay(
    drive_n: Array, load_n: Array, rows: NDArray[np.int64], direction: Array, sample_time_s: float
) -> list[Finding]:
    """Return the finding ``load_delay`` if the load cell is clearly late or early.

    Args:
        drive_n: What drives the piston, shape ``(n,)`` [N].
        load_n: What the load cell reads, shape ``(n,)`` [N].
        rows: Indices of rows, evenly chosen, in which the piston clearly moves, shape ``(m,)``.
        direction: 1 extending, -1 retracting, of each of these rows, shape ``(m,)``.
        sample_time_s: Between two samples [s].
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
    """Return how much later the load was logged than the pressures, and its standard error [s].

    Rows within a window count as one. None if the load changes too little, or explains too little, to show a delay.
    """
    window, most = (max(1, round(time_s / sample_time_s)) for time_s in (WINDOW_S, LONGEST_S))
    stride = int(np.diff(rows).min()) if len(rows) > 1 else 1
    # The rows before which the piston has moved in one direction for a whole window
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
