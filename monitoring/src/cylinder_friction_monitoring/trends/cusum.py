"""Test an indicator against its reference: a two-sided CUSUM of whitened sessions, and its threshold."""

import math
from dataclasses import dataclass

import numba
import numpy as np

from cylinder_friction_monitoring.arrays import Array, Mask
from cylinder_friction_monitoring.trends.reference import Reference

SLACK = 0.5  # CUSUM allowance, in standard deviations of an innovation
SLACK_UNCERTAIN = 3.0  # Further allowance, in standard uncertainties of the expected value
WIDEST = 1.0
"""Largest uncertainty of an expected value [standard deviations of a session]. A session beyond it is not tested: its
oil, pressure, speed or load is too far from the baseline."""
GREATEST = 5.0  # Largest deviation that counts [standard deviations]: one session alone gives no alarm

_SESSIONS = (30, 60, 90, 180, 250)
_AUTOCORRELATIONS = (0.0, 0.3, 0.6)
_BEGINS = ((1.05, 1.16, 0.63), (-0.11, 0.93, 1.35), (0.40, 0.65, 1.19), (1.60, 1.69, 2.01), (2.44, 2.27, 2.48))
_FALLS = ((0.73, 0.75, 1.03), (1.13, 0.81, 0.68), (1.11, 0.93, 0.80), (0.78, 0.74, 0.61), (0.62, 0.67, 0.55))
_MARGIN = 1.25
"""Factor on the threshold for sessions that are not normal, or correlated in another way than in the simulation."""


@dataclass(frozen=True)
class Cusum:
    """Test results of each session, shape ``(sessions,)``; NaN before the baseline ends."""

    upward: Array  # Statistics, in standard deviations of an innovation
    downward: Array
    tested: Mask  # False if a session has no value or is too far from the baseline
    smallest: float  # Smallest lasting change that adds to the statistic, averaged over the baseline


def cusum(reference: Reference, residuals: Array, uncertainties: Array, design: Array, baseline: int) -> Cusum:
    """Test the sessions after the first ``baseline`` ones, which are the baseline.

    ``residuals`` (values less expected values) and ``uncertainties`` of the single values have shape
    ``(sessions,)``, NaN if not known; ``design`` holds the regressors, shape ``(sessions, coefficients)``.
    """
    phi = reference.autocorrelation
    known = np.isfinite(residuals) & np.isfinite(design).all(axis=1)
    filled, regressors = np.where(known, residuals, 0.0), np.where(known[:, None], design, 0.0)
    near = known & (reference.uncertainty(regressors) <= WIDEST * reference.scatter)
    rows = np.flatnonzero(known)
    innovation, change = np.full(len(known), np.nan), np.zeros_like(regressors)
    innovation[rows[1:]] = filled[rows[1:]] - phi * filled[rows[:-1]]
    change[rows[1:]] = regressors[rows[1:]] - phi * regressors[rows[:-1]]
    noisier = np.nan_to_num(np.maximum(uncertainties**2 - reference.noise**2, 0.0))
    score = innovation / np.sqrt(reference.innovation**2 + noisier)
    slack = SLACK + SLACK_UNCERTAIN * reference.uncertainty(change) / reference.innovation
    tested = near & np.isfinite(score) & (np.arange(len(known)) >= baseline)
    upward, downward = _sums(np.clip(np.nan_to_num(score), -GREATEST, GREATEST), slack, tested)
    before = np.arange(len(known)) < baseline
    smallest = float(np.mean(slack[:baseline]) * reference.innovation / (1.0 - phi))
    return Cusum(np.where(before, np.nan, upward), np.where(before, np.nan, downward), tested, smallest)


def threshold(baseline: int, autocorrelation: float, false_alarms_per_year: float, sessions_per_year: float) -> float:
    """Compute the threshold of one indicator for a given rate of false alarms [standard deviations].

    ``tools/thresholds.py`` simulates baselines with four regressors and a season, then a year of 365 sessions. The
    greatest statistic of a year has an exponential tail. The tables contain the beginning and the slope of that tail.
    """
    begins, falls = (_between(table, baseline, autocorrelation) for table in (_BEGINS, _FALLS))
    return _MARGIN * (begins + falls * math.log(max(sessions_per_year / 365.0 / false_alarms_per_year, math.e**2)))


def _between(table: tuple[tuple[float, ...], ...], baseline: int, autocorrelation: float) -> float:
    by_phi = [float(np.interp(autocorrelation, _AUTOCORRELATIONS, row)) for row in table]
    return float(np.interp(1.0 / math.sqrt(baseline), [1.0 / math.sqrt(n) for n in _SESSIONS[::-1]], by_phi[::-1]))


@numba.njit(cache=True)
def _sums(score: Array, slack: Array, tested: Mask) -> tuple[Array, Array]:
    upward, downward = np.zeros_like(score), np.zeros_like(score)
    up = down = 0.0
    for row in range(len(score)):
        if tested[row]:
            up = max(0.0, up + score[row] - slack[row])
            down = max(0.0, down - score[row] - slack[row])
        upward[row], downward[row] = up, down
    return upward, downward
