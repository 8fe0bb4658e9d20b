"""Regression towards least absolute error, robust against outliers, by iteratively reweighted least squares."""

import numpy as np

from cylinder_friction.arrays import Array

RIDGE = 1e-6
"""Penalty of standardised weights, as a share of the mean squared regressor: keeps collinear columns in bounds."""


def robust_weights(design: Array, target: Array, small: float, passes: int) -> Array:
    """Return the weights, shape ``(k,)``, of least Huber loss on regressors ``(n, k)``: squared within a ``small``
    residual, absolute beyond. Rows are reweighted in each of the passes (Holland and Welsch 1977)."""
    scale = np.sqrt((design**2).mean(axis=0)) + 1e-12
    scaled = design / scale
    importance = np.ones(len(target))
    found = np.zeros(design.shape[1])
    for _ in range(passes):
        weighted = scaled * importance[:, None]
        gram = weighted.T @ scaled
        found = np.linalg.solve(gram + RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram)), weighted.T @ target)
        importance = small / np.maximum(small, np.abs(target - scaled @ found))
    return np.asarray(found / scale)
