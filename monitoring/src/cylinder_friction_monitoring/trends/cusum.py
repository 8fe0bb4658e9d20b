"""The test of an indicator against its reference: a two-sided CUSUM of whitened sessions, and its threshold."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np

from cylinder_friction_monitoring.arrays import Array, Mask
from cylinder_friction_monitoring.trends.reference import Reference

SLACK = 0.5
"""A session counts by what it deviates beyond so many standard deviations of an innovation."""
SLACK_UNCERTAIN = 3.0
"""And beyond so many standard uncertainties of what is expected of it."""
GREATEST = 5.0
"""No session counts for more standard deviations than this: one alone gives no alarm."""

_SESSIONS = (30, 60, 90, 180, 250)
_AUTOCORRELATIONS = (0.0, 0.3, 0.6)
_BEGINS = ((1.05, 1.16, 0.63), (-0.11, 0.93, 1.35), (0.40, 0.65, 1.19), (1.60, 1.69, 2.01), (2.44, 2.27, 2.48))
_FALLS = ((0.73, 0.75, 1.03), (1.13, 0.81, 0.68), (1.11, 0.93, 0.80), (0.78, 0.74, 0.61), (0.62, 0.67, 0.55))
_MARGIN = 1.25
"""For what the simulation lacks: sessions that are not normally distributed, and autocorrelation of other shapes."""


@dataclass(frozen=True)
class Cusum:
    """The test of each session, all of shape ``(sessions,)``; NaN before the baseline ends."""

    upward: Array  # Statistics, in standard deviations of an innovation
    downward: Array
    tested: Mask  # False if the session has no value, or is too far from what the baseline holds
    smallest: float  # Smallest lasting change that adds to the statistic, the baseline's sessions on average


def cusum(
    reference: Reference, residuals: Array, uncertainties: Array, design: Array, baseline: int, widest: float
) -> Cusum:
    """Return the test of sessions, the baseline's first.

    Args:
        reference: What is expected.
        residuals: Values less what is expected, shape ``(sessions,)``; NaN if there is no value.
        uncertainties: Of each value by itself, shape ``(sessions,)``; NaN if not known.
        design: Regressors, shape ``(sessions, coefficients)``.
        baseline: How many sessions the baseline has.
        widest: As ``MonitorPlan.widest``.
    """
    phi = reference.autocorrelation
    known = np.isfinite(residuals) & np.isfinite(design).all(axis=1)
    filled, regressors = np.where(known, residuals, 0.0), np.where(known[:, None], design, 0.0)
    near = known & (reference.uncertainty(regressors) <= widest * reference.scatter)
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
    """Return the threshold of one indicator that gives so many false alarms a year [standard deviations].

    Simulated: baselines of each length with four regressors and a season, then a year of 365 sessions, tested by this
    very module (``tools/thresholds.py``). The greatest statistic of a year has an exponential tail, of
    which the table holds where it begins and how it falls; a margin comes on top.
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
