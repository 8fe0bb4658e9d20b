"""Bounds around an estimate: split conformal prediction within each regime of motion.

The errors of an estimate on recordings that it did not learn from are sorted by regime, and their quantiles become the
bounds (split conformal prediction: Vovk, Gammerman and Shafer 2005; within groups: Vovk, Lindsay, Nouretdinov and
Gammerman 2003, "Mondrian confidence machine"). The regime is told from the causal velocity, so that every runtime knows
it at once. Neighbouring samples are alike, so the finite-sample guarantee, which wants exchangeable errors, does not
hold to the letter; coverage is measured on the test recordings instead.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.realtime.model import Bounds
from cylinder_friction.signals.causal import FirFilter, one_sided_savitzky_golay_taps

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

    Array = NDArray[np.float64]

REGIMES = ("standstill", "creep", "sliding", "reversal")
STANDSTILL, CREEP, SLIDING, REVERSAL = range(4)
STANDSTILL_M_S = 1e-3
CREEP_M_S = 16e-3
"""Twice the rig's Stribeck velocity: below, friction still falls with velocity."""
REVERSAL_S = 0.1
PROBABILITY = 0.9
VELOCITY_WINDOW = 21
VELOCITY_ORDER = 2
UNKNOWN_N = 1e9
"""Offset of bounds that nobody calibrated: so wide that they say nothing."""


def velocity_taps(sample_time_s: float) -> Array:
    """Return the taps, shape ``(3, 21)``, of the causal velocity [m/s] that regimes go by."""
    taps = np.zeros((3, VELOCITY_WINDOW))
    taps[2] = one_sided_savitzky_golay_taps(VELOCITY_WINDOW, VELOCITY_ORDER, 1, sample_time_s)
    return taps


def unknown_bounds(sample_time_s: float) -> Bounds:
    """Return bounds that say nothing, for an estimator that was never calibrated."""
    wide = (UNKNOWN_N, UNKNOWN_N, UNKNOWN_N, UNKNOWN_N)
    return _bounds((-UNKNOWN_N, -UNKNOWN_N, -UNKNOWN_N, -UNKNOWN_N), wide, sample_time_s, 1.0)


def calibrate_bounds(
    estimator: FrictionEstimator,
    recordings: Sequence[Recording],
    warm_up_samples: int,
    probability: float = PROBABILITY,
) -> Bounds:
    """Return bounds between which the label lies with ``probability``, half of the rest on either side.

    Args:
        estimator: Fitted; must not have learnt from ``recordings``.
        recordings: Labelled; their usable rows count, but for the first ``warm_up_samples``.
        warm_up_samples: Rows at each recording's start that are left out.
        probability: In (0, 1).
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability must be in (0, 1), but got {probability!r}")
    errors, regime = [], []
    for recording in recordings:
        counted = recording.usable().copy()
        counted[:warm_up_samples] = False
        errors.append((recording.column("friction_n") - estimator.estimate(recording))[counted])
        regime.append(regimes_of(recording)[counted])
    every, regimes = np.concatenate([np.empty(0), *errors]), np.concatenate([np.empty(0, dtype=np.int64), *regime])
    sample_time_s = estimator.sample_time_s
    assert sample_time_s is not None
    lower, upper = zip(*(_offsets(every, every[regimes == one], probability) for one in range(4)), strict=True)
    return _bounds(lower, upper, sample_time_s, probability)


def regimes_of(recording: Recording) -> NDArray[np.int64]:
    """Return the regime of each row, shape ``(n,)``, as the real-time step tells it on clean samples."""
    block = FirFilter(velocity_taps(recording.sample_time_s)[None])
    velocity = block.advance(block.new_state(), recording.samples())[:, 0]
    return regimes(velocity, STANDSTILL_M_S, CREEP_M_S, round(REVERSAL_S / recording.sample_time_s))


@numba.njit(cache=True)
def regimes(velocity_m_s: Array, standstill_m_s: float, creep_m_s: float, reversal_samples: int) -> NDArray[np.int64]:
    """Return the regime of each step, shape ``(n,)``: see ``next_regime``."""
    result = np.empty(velocity_m_s.shape[0], dtype=np.int64)
    direction, left = 0, 0
    for row in range(velocity_m_s.shape[0]):
        result[row], direction, left = next_regime(
            velocity_m_s[row], direction, left, standstill_m_s, creep_m_s, reversal_samples
        )
    return result


@numba.njit(cache=True)
def next_regime(
    velocity_m_s: float, direction: int, left: int, standstill_m_s: float, creep_m_s: float, reversal_samples: int
) -> tuple[int, int, int]:
    """Return this step's regime, direction and what is left of a reversal, from those of the step before.

    Direction is 0 below ``standstill_m_s``, else the velocity's sign. A new direction other than 0 begins a reversal
    (or start) of ``reversal_samples`` steps, this one included, whatever the velocity is in them.
    """
    now = 0
    if velocity_m_s >= standstill_m_s:
        now = 1
    elif velocity_m_s <= -standstill_m_s:
        now = -1
    if now != 0 and now != direction:
        left = reversal_samples
    if left > 0:
        return 3, now, left - 1
    if now == 0:
        return 0, now, left
    if abs(velocity_m_s) < creep_m_s:
        return 1, now, left
    return 2, now, left


def _offsets(every: Array, errors: Array, probability: float) -> tuple[float, float]:
    """Return the finite-sample quantiles of a regime's errors; of all where the regime has too few."""
    side = 1.0 - (1.0 - probability) / 2.0
    for values in (errors, every):
        rank = math.ceil((len(values) + 1) * side)
        if rank <= len(values):
            ordered = np.sort(values)
            return float(ordered[len(values) - rank]), float(ordered[rank - 1])
    return -UNKNOWN_N, UNKNOWN_N


def _bounds(lower: Sequence[float], upper: Sequence[float], sample_time_s: float, probability: float) -> Bounds:
    return Bounds(
        lower_n=(lower[0], lower[1], lower[2], lower[3]),
        upper_n=(upper[0], upper[1], upper[2], upper[3]),
        standstill_m_s=STANDSTILL_M_S,
        creep_m_s=CREEP_M_S,
        reversal_samples=round(REVERSAL_S / sample_time_s),
        probability=probability,
    )
