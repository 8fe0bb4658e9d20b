"""Date a change by fitting shapes after the alarm, and determine its size from the latest sessions."""

from dataclasses import dataclass, replace

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
LATEST = 60  # Most sessions that show the present change and its rate
LEAST_TREND = 10  # Fewest sessions since a change begins that show its rate
LAST_PART = 4  # Fewest sessions that show that a change has stopped, or goes on faster or slower
LEVEL = 1e-4  # Standard deviation of the slope of a line that is level, as a share of that of any other


@dataclass(frozen=True)
class Dated:
    """A change of residuals, in the indicator's unit."""

    begins: int  # Session from which residuals differ
    interval: tuple[int, int]  # First and last session at which it may have begun
    step: bool  # Whether a step explains it better than a ramp
    change: float  # Present change
    change_interval: tuple[float, float]  # 95 % interval, including the uncertainty of expected values
    slope: float | None = None  # Present slope per day; None while too few sessions show it
    slope_interval: tuple[float, float] | None = None  # 95 % interval; it includes 0 unless the trend is clear


def dated(
    reference: Reference, residuals: Array, expected: Array, design: Array, days: Array, first: int, alarm: int
) -> Dated:
    """Date the change of residuals between session ``first`` and the ``alarm``, and determine its present size.

    ``residuals``, ``expected`` (the standard uncertainty of each expected value) and ``days`` (when sessions began)
    have shape ``(sessions,)``. ``design`` holds the regressors, shape ``(sessions, coefficients)``, because later
    sessions refine their effects.
    """
    begins, interval, step = _begins(reference, residuals, design, first, alarm)
    latest = slice(max(begins, len(residuals) - LATEST), None)
    (now, slope), (spread, slopes) = _present(reference, days[latest] - days[-1], residuals[latest])
    wide = Z95 * float(np.hypot(spread, expected[-1]))
    found = Dated(begins, interval, step, now, (now - wide, now + wide))
    if len(residuals) - begins < LEAST_TREND:
        return found
    return replace(found, slope=slope, slope_interval=(slope - Z95 * slopes, slope + Z95 * slopes))


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


def _present(reference: Reference, days: Array, values: Array) -> tuple[list[float], list[float]]:
    """Estimate the present change and its slope per day; return both, and their standard uncertainties.

    ``days`` count back from the last session. The change is two straight lines that meet at an unknown session, and the
    last one may be level. All such lines count by their likelihood, so that a change that has stopped includes a slope
    of 0, and one that goes on includes that it may have stopped since a few sessions.
    """
    bends = days[1:-LAST_PART] if len(days) > LAST_PART + 2 else days[:1]
    before = np.minimum(days - bends[:, None], 0.0)
    x = _whitened(reference, np.stack(np.broadcast_arrays(1.0, days, before), axis=1))
    y = _whitened(reference, values)
    found_noise = 0.5 * float(np.sum(np.diff(y) ** 2)) / max(len(y), LEAST_RAMP)
    noise = max(reference.innovation**2, found_noise)
    size = abs(float(values[-LEAST_RAMP:].mean())) + reference.scatter
    slopes = np.array([[LEVEL, 1.0], [1.0, 1.0]]) * 2.0 * size / max(-float(days[0]), LEAST_RAMP)
    priors = np.column_stack([np.zeros(len(slopes)), slopes**-2.0])
    precision = x @ x.transpose(0, 2, 1) / noise + priors[:, None, None] * np.eye(3)
    covariance, weighted = np.linalg.inv(precision), x @ y / noise
    found = (covariance @ weighted[..., None])[..., 0]
    likelihood = (found * weighted).sum(axis=2) - np.linalg.slogdet(precision)[1]
    likelihood = 0.5 * likelihood - np.log(slopes).sum(axis=1)[:, None]
    weights = np.exp(likelihood - likelihood.max())[..., None]
    weights /= weights.sum()
    means = (weights * found).sum(axis=(0, 1))
    squares = (weights * (found**2 + np.diagonal(covariance, axis1=2, axis2=3))).sum(axis=(0, 1))
    return means[:2].tolist(), np.sqrt(np.maximum(squares - means**2, 0.0))[:2].tolist()


def _whitened(reference: Reference, values: Array) -> Array:
    """Subtract the part that the session before explains, and give the first session equal weight."""
    first = np.sqrt(1.0 - reference.autocorrelation**2) * values[..., :1]
    return np.concatenate([first, _less_before(reference, values)], axis=-1)


def _less_before(reference: Reference, values: Array) -> Array:
    """Subtract the part that the session before explains, along the last axis; drop the first session."""
    return values[..., 1:] - reference.autocorrelation * values[..., :-1]
