"""Confidence intervals of parameters identified by least absolute error."""

import math
from dataclasses import replace

import numpy as np
from scipy.special import ndtri, stdtrit

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.identification.simulation import Motions
from cylinder_friction.friction_models.parameters import ModelParameters

INTERVAL_METHOD = "sandwich covariance of least absolute error, scores summed over blocks of 2 s, in logarithms"

_BLOCK_S = 2.0
_RELATIVE_STEP = 0.01
_GREATEST_LOG = math.log(1e3)


def confidence_intervals(
    motions: Motions,
    parameters: ModelParameters,
    names: tuple[str, ...],
    confidence: float,
    offset_n: float = 0.0,
    recordings_differ: bool = False,
) -> dict[str, tuple[float, float]]:
    """Compute the confidence interval of each named parameter, in the parameter's own unit.

    With residuals ``r`` and sensitivities ``J`` of friction to the logarithm of each parameter, the estimate
    has the covariance ``H^-1 S H^-1``. ``H`` is ``2 f(0) J'J`` with the density ``f`` of residuals at zero, and ``S``
    is the sum over blocks of ``(J' sgn r)(J' sgn r)'``. Residuals within a block may be correlated; only the blocks
    must be independent. A parameter that the motion does not determine gets a wide interval, at most a factor of a
    thousand either way. All friction may have an offset with the standard uncertainty ``offset_n`` [N]; what it shifts
    is part of each interval. If ``recordings_differ``, as with the oil's temperature, intervals also hold the scatter
    of whole recordings: scores are summed over each, and the quantile is Student's for their number.
    ``parameters`` is the best result of the search, and ``names`` are its searched fields, all of them positive.

    Source: Koenker and Bassett 1978 for the law, Parente and Santos Silva 2016 for clusters.
    """
    usable = motions.usable
    residual = (motions.friction_n - motions.simulated(parameters.packed()))[usable]
    sensitivity = np.column_stack([_sensitivity(motions, parameters, name)[usable] for name in names])
    scores = sensitivity * np.sign(residual)[:, None]
    totals = _block_sums(motions, scores)
    density = _density_at_zero(residual)
    curvature = 2.0 * density * (sensitivity.T @ sensitivity)
    inverse = np.linalg.pinv(curvature, rcond=1e-10, hermitian=True)
    shifted = inverse @ (2.0 * density * offset_n * sensitivity.sum(axis=0))
    covariance = inverse @ (totals.T @ totals) @ inverse + np.outer(shifted, shifted)
    variances = float(ndtri(0.5 + 0.5 * confidence)) ** 2 * np.diag(covariance)
    count = len(motions.starts) - 1
    if recordings_differ and count > 1:
        recording = np.repeat(np.arange(count), np.diff(motions.starts))[usable]
        totals = np.zeros((count, len(names)))
        np.add.at(totals, recording, scores)
        covariance = inverse @ (totals.T @ totals) @ inverse * (count / (count - 1)) + np.outer(shifted, shifted)
        reach = float(stdtrit(count - 1, 0.5 + 0.5 * confidence))
        variances = np.maximum(variances, reach**2 * np.diag(covariance))
    intervals = {}
    for number, name in enumerate(names):
        felt = bool(np.abs(sensitivity[:, number]).max() > 0.0)
        half = min(math.sqrt(max(variances[number], 0.0)), _GREATEST_LOG) if felt else _GREATEST_LOG
        value = getattr(parameters, name)
        intervals[name] = (value * math.exp(-half), value * math.exp(half))
    return intervals


def _sensitivity(motions: Motions, parameters: ModelParameters, name: str) -> Array:
    """Compute the change of friction with the logarithm of one parameter [N], shape ``(rows,)``.

    If Coulomb friction steps above static friction, static friction rises too; it never steps below Coulomb friction.
    """
    value = getattr(parameters, name)
    down, up = value * math.exp(-_RELATIVE_STEP), value * math.exp(_RELATIVE_STEP)
    above = _changed(parameters, name, up)
    below = _changed(parameters, name, down)
    width = math.log(getattr(above, name) / getattr(below, name))
    return (motions.simulated(above.packed()) - motions.simulated(below.packed())) / width


def _changed(parameters: ModelParameters, name: str, value: float) -> ModelParameters:
    if name == "coulomb_n":
        with_it = {"static_n": max(parameters.value("static_n"), value)} if hasattr(parameters, "static_n") else {}
        return replace(parameters, **{name: value}, **with_it)
    if name == "static_n":
        value = max(value, parameters.value("coulomb_n"))
    return replace(parameters, **{name: value})


def _block_sums(motions: Motions, scores: Array) -> Array:
    length = max(1, round(_BLOCK_S / motions.sample_time_s))
    blocks = np.empty(len(motions.usable), dtype=np.int64)
    first = 0
    for start, end in zip(motions.starts[:-1], motions.starts[1:], strict=True):
        blocks[start:end] = first + np.arange(end - start) // length
        first = int(blocks[end - 1]) + 1
    totals = np.zeros((first, scores.shape[1]))
    np.add.at(totals, blocks[motions.usable], scores)
    return totals


def _density_at_zero(residual: Array) -> float:
    """Compute the density of residuals at zero [1/N]: their share within a bandwidth that narrows as ``n**(-1/5)``."""
    spread = max(1.4826 * float(np.median(np.abs(residual))), 1e-9)
    half_width = spread * len(residual) ** (-1.0 / 5.0)
    inside = float(np.mean(np.abs(residual) <= half_width))
    return max(inside, 1.0 / len(residual)) / (2.0 * half_width)
