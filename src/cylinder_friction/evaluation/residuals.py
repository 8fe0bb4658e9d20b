"""Residuals, friction less the estimate: their distribution, their autocorrelation and what they still depend on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cylinder_friction.arrays import Array, Mask, true_runs

_QUANTILE_POINTS = 199
_LJUNG_BOX_LAGS = 10


@dataclass(frozen=True)
class ResidualFigures:
    """Residuals in numbers; a residual is reference minus estimate, so a positive one is an underestimate."""

    rows: int  # Number of residuals
    # Mean and standard deviation [N]
    mean_n: float
    deviation_n: float
    # Quartiles [N]
    lower_quartile_n: float
    median_n: float
    upper_quartile_n: float
    skewness: float  # Third standardised moment; if positive, the long tail is at underestimates
    excess_kurtosis: float  # Fourth standardised moment less 3; 0 for a normal distribution
    # Test of normality. With 10^5 rows it rejects any real residual: read the size of skewness and kurtosis, not the
    # p-value
    jarque_bera: float
    jarque_bera_p: float
    autocorrelation_1: float  # Autocorrelation at one sample
    # Test of independence over 10 lags, on the longest uninterrupted run of usable rows
    ljung_box: float
    ljung_box_p: float
    effective_rows: float  # Number of independent residuals with the same information about their mean


def residual_figures(residual_n: Array, usable: Mask) -> ResidualFigures:
    """Compute figures of a series of residuals (reference minus estimate) in the order of time.

    Only usable rows count; put an unusable row between two recordings. Moments, autocorrelation and tests are NaN if
    the residuals do not vary.
    """
    values = residual_n[usable]
    if len(values) == 0:
        raise ValueError(f"none of the {len(usable)} rows is usable; expected at least one")
    lower, median, upper = (float(value) for value in np.quantile(values, (0.25, 0.5, 0.75)))
    varies = len(values) > 3 and float(np.ptp(values)) > 1e-12 * max(1.0, float(np.abs(values).max()))
    skewness = excess = bera = bera_p = first = effective = math.nan
    box, box_p = math.nan, math.nan
    if varies:
        skewness, excess = float(stats.skew(values)), float(stats.kurtosis(values))
        normality = stats.jarque_bera(values)
        bera, bera_p = float(normality.statistic), float(normality.pvalue)
        memory = autocorrelation(residual_n, usable, len(residual_n) - 1)
        first = float(memory[1])
        effective = _effective_rows(memory, len(values))
        box, box_p = _ljung_box(residual_n, usable)
    return ResidualFigures(
        rows=len(values),
        mean_n=float(values.mean()),
        deviation_n=float(values.std()),
        lower_quartile_n=lower,
        median_n=median,
        upper_quartile_n=upper,
        skewness=skewness,
        excess_kurtosis=excess,
        jarque_bera=bera,
        jarque_bera_p=bera_p,
        autocorrelation_1=first,
        ljung_box=box,
        ljung_box_p=box_p,
        effective_rows=effective,
    )


def autocorrelation(residual_n: Array, usable: Mask, lags: int) -> Array:
    """Compute the autocorrelation at 0 to ``lags`` samples, shape ``(lags + 1,)``, over pairs of usable rows.

    Missing rows count as missing, not as zero (Parzen 1963); a lag without any pair gives 0. All NaN if the
    residuals do not vary.
    """
    lags = min(lags, len(residual_n) - 1)
    centred = np.where(usable, residual_n - residual_n[usable].mean(), 0.0)
    products = _lagged_sums(centred, lags)
    pairs = np.rint(_lagged_sums(usable.astype(np.float64), lags))
    if products[0] <= 0.0:
        return np.full(lags + 1, math.nan)
    means = np.divide(products, pairs, out=np.zeros_like(products), where=pairs > 0.5)
    return np.asarray(means / means[0], dtype=np.float64)


def quantile_points(values: Array) -> tuple[Array, Array]:
    """Compute a Q-Q plot's points: normal quantiles with the values' mean and deviation, and the values' own [N]."""
    probabilities = (np.arange(_QUANTILE_POINTS) + 0.5) / _QUANTILE_POINTS
    normal = float(values.mean()) + float(values.std()) * stats.norm.ppf(probabilities)
    return np.asarray(normal, dtype=np.float64), np.quantile(values, probabilities)


def dependence(residual_n: Array, usable: Mask, inputs: Mapping[str, Array]) -> dict[str, float]:
    """Compute the correlation of the residual with each input over the usable rows; 0 if an input never varies."""
    residual = residual_n[usable] - residual_n[usable].mean()
    result: dict[str, float] = {}
    for name, values in inputs.items():
        centred = values[usable] - values[usable].mean()
        scale = float(np.sqrt(np.mean(centred**2) * np.mean(residual**2)))
        result[name] = float(np.mean(centred * residual)) / scale if scale > 0.0 else 0.0
    return result


def _lagged_sums(values: Array, lags: int) -> Array:
    size = 1 << (2 * len(values) - 1).bit_length()
    spectrum = np.fft.rfft(values, size)
    return np.fft.irfft(spectrum * np.conj(spectrum), size)[: lags + 1]


def _effective_rows(memory: Array, rows: int) -> float:
    """Rows divided by the integrated autocorrelation up to its first value that is not positive (after Geyer 1992)."""
    stop = np.flatnonzero(memory[1:] <= 0.0)
    last = int(stop[0]) + 1 if len(stop) else len(memory)
    return float(rows / (1.0 + 2.0 * float(memory[1:last].sum())))


def _ljung_box(residual_n: Array, usable: Mask) -> tuple[float, float]:
    starts, stops = true_runs(usable).T
    longest = int(np.argmax(stops - starts))
    run = residual_n[starts[longest] : stops[longest]]
    lags = min(_LJUNG_BOX_LAGS, len(run) // 5)
    if lags < 1 or float(np.ptp(run)) == 0.0:
        return math.nan, math.nan
    memory = _lagged_sums(run - run.mean(), lags)
    behind = np.arange(1, lags + 1)
    statistic = len(run) * (len(run) + 2) * float(((memory[1:] / memory[0]) ** 2 / (len(run) - behind)).sum())
    return statistic, float(stats.chi2.sf(statistic, lags))
