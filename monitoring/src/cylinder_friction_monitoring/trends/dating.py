"""Date a change by fitting shapes after the alarm, and determine its size from the latest sessions."""

from dataclasses import dataclass

import numpy as np

from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.reference import Reference

Z95 = 1.96
LIKELY = 4.0  # Largest distance of a possible beginning's log-likelihood from the best one
LEAST_RAMP = 5
POWERS = (0.0, 1.0, 2.0, 3.0)
"""Powers of the shapes of a change: step, ramp, and accelerating growth, which must be far likelier to be used."""
WINDOWS = (0, 7, 15, 30, 60)
"""Numbers of sessions after the alarm that date a change. After the last number, its date is final."""
UNUSUAL = 1.0
"""Largest deviation of a window's sessions from the best shape at which the window counts [standard deviations]."""
LATEST, LEAST_TREND = 60, 10  # Most sessions for the present change, and fewest for its rate


@dataclass(frozen=True)
class Dated:
    """A change of residuals, in the indicator's unit."""

    begins: int  # Session from which residuals differ
    interval: tuple[int, int]  # First and last session at which it may have begun
    step: bool  # Whether a step explains it better than a ramp
    change: float  # Present change
    change_interval: tuple[float, float]  # 95 % interval, including the uncertainty of expected values
    slope: float | None  # Present slope per session; None without a clear trend
    slope_interval: tuple[float, float] | None  # 95 % interval


def dated(reference: Reference, residuals: Array, expected: Array, design: Array, first: int, alarm: int) -> Dated:
    """Date the change of residuals between session ``first`` and the ``alarm``, and determine its present size.

    ``residuals`` and ``expected``, the standard uncertainty of each expected value, have shape ``(sessions,)``.
    ``design`` holds the regressors, shape ``(sessions, coefficients)``, because later sessions refine their effects.
    """
    begins, interval, step = _begins(reference, residuals, design, first, alarm)
    latest = residuals[max(begins, len(residuals) - LATEST) :]
    sessions = np.arange(len(latest)) - len(latest) + 1.0
    level, spread = _regression(reference, np.ones((len(latest), 1)), latest)
    slope = slopes = None
    if len(latest) >= LEAST_TREND:
        line, spreads = _regression(reference, np.column_stack([np.ones(len(latest)), sessions]), latest)
        if abs(line[1]) > Z95 * spreads[1]:
            level, spread, slope = line, spreads, float(line[1])
            slopes = (slope - Z95 * float(spreads[1]), slope + Z95 * float(spreads[1]))
    wide = Z95 * float(np.hypot(spread[0], expected[-1]))
    now = float(level[0])
    return Dated(begins, interval, step, now, (now - wide, now + wide), slope, slopes)


def _begins(
    reference: Reference, residuals: Array, design: Array, first: int, alarm: int
) -> tuple[int, tuple[int, int], bool]:
    """Find the beginning that explains residuals best, its interval, and whether the change is a step.

    If no shape fits all sessions, those nearer to the alarm give the date. The interval spans the intervals of both.
    """
    usual, intervals = 1.0, list[tuple[int, int]]()
    for window in WINDOWS:
        rows = slice(alarm + 1 + window)
        losses, unexplained = _losses(reference, residuals[rows], design[rows], first, alarm)
        loss = losses.min(axis=0)
        possible = first + np.flatnonzero(loss <= loss.min() + LIKELY)
        usual = max(unexplained, 1.0) if window == WINDOWS[0] else usual
        if unexplained <= usual * (1.0 + UNUSUAL * np.sqrt(2.0 / len(residuals[rows]))):
            best, intervals = losses, []
        intervals.append((int(possible[0]), int(possible[-1])))
    loss, simple = best.min(axis=0), best[:2].min(axis=0)
    likeliest = simple if simple.min() <= loss.min() + LIKELY else loss
    firsts, lasts = zip(*intervals, strict=True)
    step = bool(best[0].min() <= best[1:].min())
    return first + int(np.argmin(likeliest)), (min(firsts), max(lasts)), step


def _losses(reference: Reference, residuals: Array, design: Array, first: int, alarm: int) -> tuple[Array, float]:
    """Fit each shape from each beginning.

    Return negative log-likelihoods less a constant, shape ``(shapes, alarm + 1 - first)``, and the mean square residual
    of the best fit, in variances of an innovation.
    """
    begins, sessions = np.arange(first, alarm + 1)[:, None], np.arange(len(residuals))
    parts, sizes, _ = np.linalg.svd(_less_before(reference, design.T).T, full_matrices=False)
    explained = parts[:, sizes > 1e-9 * sizes[0]]
    y = _less_before(reference, residuals)
    y = y - explained @ (explained.T @ y)
    since, losses = np.maximum(sessions - begins + 1.0, 0.0), []
    for power in POWERS:
        x = _less_before(reference, np.where(since > 0.0, since**power, 0.0))
        x = x - (x @ explained) @ explained.T
        loss = -((x @ y) ** 2) / np.maximum((x**2).sum(axis=1), 1e-12) / (2.0 * reference.innovation**2)
        short = len(residuals) - begins[:, 0] < LEAST_RAMP * power
        losses.append(np.where(short, np.inf, loss))
    left = float(y @ y) / reference.innovation**2 + 2.0 * min(float(each.min()) for each in losses)
    return np.array(losses), left / len(y)


def _regression(reference: Reference, x: Array, y: Array) -> tuple[Array, Array]:
    """Fit coefficients with standard uncertainties to residuals that have the baseline's autocorrelation."""
    phi = reference.autocorrelation
    first = np.sqrt(1.0 - phi**2)
    x = np.vstack([first * x[:1], _less_before(reference, x.T).T])
    y = np.append(first * y[:1], _less_before(reference, y))
    covariance = np.linalg.inv(x.T @ x)
    return covariance @ x.T @ y, reference.innovation * np.sqrt(np.diag(covariance))


def _less_before(reference: Reference, values: Array) -> Array:
    """Subtract the part that the session before explains, along the last axis; drop the first session."""
    return values[..., 1:] - reference.autocorrelation * values[..., :-1]
