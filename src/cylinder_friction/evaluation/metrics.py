"""How far an estimate is from a reference: errors in newtons and in percent, and how late the estimate is."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from cylinder_friction.arrays import Array, Mask


@dataclass(frozen=True)
class Errors:
    """Errors of one estimate over ``rows`` rows; an undefined ratio (a reference that never varies) is NaN."""

    rows: int  # Number of rows that count
    mae_n: float  # Mean absolute error [N]
    rmse_n: float  # Root of the mean squared error [N]
    bias_n: float  # Mean of estimate minus reference [N]; positive if the estimate is too large
    p95_n: float  # 95th percentile of the absolute error [N]
    mean_abs_friction_n: float  # Mean of the reference's absolute value [N], the denominator of ``percent``
    percent: float  # ``100 * mae_n / mean_abs_friction_n``
    fit_percent: float  # ``100 * (1 - ||e|| / ||y - mean(y)||)``, as MATLAB's ``compare`` defines it
    range_nrmse_percent: float  # ``100 * rmse_n / (max(y) - min(y))``

    def to_dict(self) -> dict[str, float]:
        """List the defined figures, without those that are NaN."""
        return {key: value for key, value in asdict(self).items() if math.isfinite(value)}


def errors(reference_n: Array, estimate_n: Array, usable: Mask) -> Errors:
    """Compute the errors of ``estimate_n`` against ``reference_n`` over the usable rows, all of shape ``(n,)``.

    The reference is label or truth; values in rows that are not usable are never looked at.

    Raises:
        ValueError: The shapes differ, no row is usable, or a usable value is NaN or infinite.
    """
    _refuse_bad(reference_n, estimate_n, usable)
    reference, estimate = reference_n[usable], estimate_n[usable]
    error = estimate - reference
    mae = float(np.mean(np.abs(error)))
    rmse = float(np.sqrt(np.mean(error**2)))
    mean_abs = float(np.mean(np.abs(reference)))
    spread = float(np.sqrt(np.mean((reference - np.mean(reference)) ** 2)))
    return Errors(
        rows=len(error),
        mae_n=mae,
        rmse_n=rmse,
        bias_n=float(np.mean(error)),
        p95_n=float(np.quantile(np.abs(error), 0.95)),
        mean_abs_friction_n=mean_abs,
        percent=100.0 * _ratio(mae, mean_abs),
        fit_percent=100.0 * (1.0 - _ratio(rmse, spread)),
        range_nrmse_percent=100.0 * _ratio(rmse, float(np.ptp(reference))),
    )


def lag_s(reference_n: Array, estimate_n: Array, usable: Mask, sample_time_s: float, maximum_lag_s: float) -> float:
    """Measure the delay of the estimate [s]: the shift at which it correlates best with the reference.

    A positive delay is late. Only pairs of usable rows count. A parabola through the peak and its neighbours gives the
    fraction of a sample. NaN if either signal never varies. Shifts up to ``maximum_lag_s`` are tried in both
    directions.
    """
    _refuse_bad(reference_n, estimate_n, usable)
    reach = max(1, round(maximum_lag_s / sample_time_s))
    shifts = range(-reach, reach + 1)
    reference = np.where(usable, reference_n, 0.0)
    estimate = np.where(usable, estimate_n, 0.0)
    correlations = np.array([_correlation_at(reference, estimate, usable, shift) for shift in shifts])
    if not np.isfinite(correlations).any():
        return math.nan
    peak = int(np.nanargmax(correlations))
    fraction = 0.0
    if 0 < peak < len(correlations) - 1:
        before, at, after = correlations[peak - 1 : peak + 2]
        curvature = before - 2.0 * at + after
        if np.isfinite(curvature) and curvature < 0.0:
            fraction = 0.5 * float(before - after) / float(curvature)
    return (peak - reach + fraction) * sample_time_s


def _correlation_at(reference: Array, estimate: Array, usable: Mask, shift: int) -> float:
    """Pearson correlation of ``reference[t]`` with ``estimate[t + shift]`` over pairs of usable rows."""
    rows = len(reference) - abs(shift)
    if rows < 2:
        return math.nan
    early, late = max(0, -shift), max(0, shift)
    both = usable[early : early + rows] & usable[late : late + rows]
    if int(both.sum()) < 2:
        return math.nan
    left = reference[early : early + rows][both]
    right = estimate[late : late + rows][both]
    left = left - left.mean()
    right = right - right.mean()
    return _ratio(float(np.mean(left * right)), float(np.sqrt(np.mean(left**2) * np.mean(right**2))))


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0.0 else math.nan


def _refuse_bad(reference_n: Array, estimate_n: Array, usable: Mask) -> None:
    if not reference_n.shape == estimate_n.shape == usable.shape:
        raise ValueError(
            f"reference, estimate and mask must have one shape, but got {reference_n.shape}, {estimate_n.shape} "
            f"and {usable.shape}"
        )
    if not usable.any():
        raise ValueError(f"none of the {len(usable)} rows is usable; expected at least one")
    for name, values in (("reference", reference_n), ("estimate", estimate_n)):
        bad = usable & ~np.isfinite(values)
        if bad.any():
            row = int(np.argmax(bad))
            raise ValueError(f"{name} is {values[row]} at row {row}; expected finite numbers in every usable row")
