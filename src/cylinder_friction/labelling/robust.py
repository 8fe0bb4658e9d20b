"""Robust linear regression, and its uncertainty when neighbouring residuals are correlated."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.stribeck import HUBER_NOISE_MULTIPLE

_GREATEST_ROUNDS = 50
_SETTLED = 1e-10


@dataclass(frozen=True)
class RobustFit:
    """A regression with Huber's loss."""

    coefficients: Array  # Shape ``(k,)``
    weights: Array  # Weight of each row, in (0, 1], shape ``(n,)``
    residuals: Array  # Target minus fit, shape ``(n,)``


def robust_fit(
    design: Array,
    target: Array,
    multiple: float = HUBER_NOISE_MULTIPLE,
    solve: Callable[[Array, Array], Any] = lambda design, target: np.linalg.lstsq(design, target, rcond=None)[0],
) -> RobustFit:
    """Fit ``target``, shape ``(n,)``, by the columns of ``design``, shape ``(n, k)``, with Huber's loss.

    The method is iteratively reweighted least squares. Huber's threshold is a ``multiple`` of the noise, measured in
    each round as a standard deviation from the median absolute residual. Identical columns share their coefficient.
    ``solve`` fits without weights; by default it finds the coefficients of smallest norm.

    Source: Huber 1981, section 7.8.
    """
    scale = np.sqrt(np.mean(design**2, axis=0))
    scale = np.where(scale > 0.0, scale, 1.0)
    scaled = design / scale
    weights = np.ones(len(target))
    coefficients: Array = np.zeros(design.shape[1])
    residuals: Array = target
    for _ in range(_GREATEST_ROUNDS):
        root = np.sqrt(weights)
        found = solve(scaled * root[:, None], target * root)
        residuals = np.asarray(target - scaled @ found)
        threshold = multiple * 1.4826 * float(np.median(np.abs(residuals)))
        settled = np.max(np.abs(found - coefficients)) <= _SETTLED * (np.max(np.abs(found)) + 1e-300)
        coefficients = np.asarray(found)
        if settled or threshold <= 0.0:
            break
        weights = np.minimum(1.0, threshold / np.maximum(np.abs(residuals), threshold))
    return RobustFit(coefficients / scale, weights, residuals)


def clustered_covariance(design: Array, fit: RobustFit, clusters: NDArray[np.int64]) -> Array:
    """Compute the coefficients' covariance, shape ``(k, k)``; infinite without more clusters than coefficients.

    Residuals of one cluster may be correlated; residuals of two clusters must not be.

    Source: sandwich covariance by clusters, Liang and Zeger 1986.
    """
    count = int(clusters.max()) + 1
    free = count - design.shape[1]
    if free < 1:
        return np.full((design.shape[1],) * 2, np.inf)
    weighted = design * fit.weights[:, None]
    scores = np.zeros((count, design.shape[1]))
    np.add.at(scores, clusters, weighted * fit.residuals[:, None])
    bread = np.linalg.pinv(weighted.T @ design, hermitian=True)
    return np.asarray(bread @ (scores.T @ scores) @ bread * (count / free))


def clustered_half_widths(design: Array, fit: RobustFit, clusters: NDArray[np.int64], confidence: float) -> Array:
    """Compute half the width of each confidence interval, shape ``(k,)``; infinite with too few clusters.

    Source: ``clustered_covariance``, with Student's t; its degrees of freedom are the number of clusters minus the
    number of coefficients.
    """
    from scipy.special import stdtrit  # slow to import

    free = max(int(clusters.max()) + 1 - design.shape[1], 1)
    variance = np.diag(clustered_covariance(design, fit, clusters))
    return np.asarray(stdtrit(free, 0.5 + 0.5 * confidence) * np.sqrt(np.maximum(variance, 0.0)))
