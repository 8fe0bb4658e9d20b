"""Friction of sliding as a curve over speed whose every part but the viscous one grows with pressure.

``|F| = c + d |v| + sum_k e_k exp(-|v| / v_k) + f h + (c' + sum_k e'_k exp(-|v| / v_k) + f' h) (P1 + P2)``, one set of
coefficients a direction. The memory ``h`` follows ``exp(-|v| / v_2)`` with a delay of 0.2 s, as the lubricant's film
does (Yanada and Sekikawa 2008). Everything is linear in the coefficients, so that robust least squares finds them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FADING_M_S = (0.004, 0.012, 0.035)
"""Speeds over which the exponentials fade [m/s]: the span of Stribeck velocities of cylinder seals."""
TERMS = 6
"""Without pressure: 1, |v|, three exponentials, memory; pressure multiplies all but |v|."""
COEFFICIENTS = 2 * TERMS - 1
RESIDUAL_FLOOR_N = 5.0
PASSES = 15
BAR_PA = 1e5


@dataclass(frozen=True)
class SlidingLaw:
    """Coefficients while extending and while retracting, shape ``(2, COEFFICIENTS)`` [N; N/bar for the last five]."""

    coefficients: Array

    @classmethod
    def fit(cls, motion: Array, pressure_bar: Array, friction_n: Array) -> SlidingLaw:
        """Return the law nearest to labelled sliding, by least absolute residuals (iteratively reweighted).

        Args:
            motion: Rows of ``sense``, shape ``(n, 4)``; rows at rest are passed over.
            pressure_bar: P1 + P2, shape ``(n,)`` [bar].
            friction_n: Labels, shape ``(n,)`` [N].
        """
        found = np.zeros((2, COEFFICIENTS))
        for side, way in enumerate((1.0, -1.0)):
            rows = motion[:, 0] * way > 0.0
            if rows.sum() > 10 * COEFFICIENTS:
                design = _design(np.abs(motion[rows, 0]), pressure_bar[rows], motion[rows, 3])
                found[side] = _least_absolute(design, way * friction_n[rows])
        if not found[1].any() or not found[0].any():
            found[:] = found.sum(axis=0)
        return cls(found)


def _design(speed: Array, pressure_bar: Array, memory: Array) -> Array:
    plain = [np.ones_like(speed), speed, *(np.exp(-speed / fading) for fading in FADING_M_S), memory]
    return np.stack([*plain, *(pressure_bar * part for part in (plain[0], *plain[2:]))], axis=1)


def _least_absolute(design: Array, target: Array) -> Array:
    scale = design.std(axis=0) + np.abs(design.mean(axis=0)) + 1e-12
    scaled = design / scale
    weights = np.ones(len(target))
    found = np.zeros(design.shape[1])
    for _ in range(PASSES):
        weighted = scaled * weights[:, None]
        gram = weighted.T @ scaled + 1e-6 * len(target) * np.diag(np.r_[0.0, np.ones(design.shape[1] - 1)])
        found = np.linalg.solve(gram, weighted.T @ target)
        weights = RESIDUAL_FLOOR_N / np.maximum(RESIDUAL_FLOOR_N, np.abs(target - scaled @ found))
    return np.asarray(found / scale)
