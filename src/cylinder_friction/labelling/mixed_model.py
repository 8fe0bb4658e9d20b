"""A linear mixed model of several groups, each with effects of its own and strokes whose rows share an error.

The common coefficients are found by generalised least squares, a group's own effects eliminated, and its variances by
restricted maximum likelihood (Henderson 1975; Patterson and Thompson 1971).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array


@dataclass(frozen=True)
class Evidence:
    """The products of one group's columns: of design, own effects and response. All else follows from them."""

    products: Array  # Summed over rows, shape ``(columns, columns)``
    means: Array  # Of each stroke, shape ``(strokes, columns)``
    counts: Array  # Rows of each stroke
    size: int  # Columns of the design

    @classmethod
    def of(cls, design: Array, own: Array, response: Array, stroke: NDArray[np.int64]) -> Self:
        """Return the evidence of one group.

        Args:
            design: Columns of the common coefficients, shape ``(n, size)``.
            own: Columns of the group's own effects, shape ``(n, effects)``.
            response: What is explained, shape ``(n,)``.
            stroke: Of each row, counted from 0, shape ``(n,)``.
        """
        columns = np.column_stack([design, own, response])
        counts = np.bincount(stroke).astype(np.float64)
        sums = np.zeros((len(counts), columns.shape[1]))
        np.add.at(sums, stroke, columns)
        return cls(columns.T @ columns, sums / counts[:, None], counts, design.shape[1])

    def reduced(self, noise: float, stroke: float, deviations: Array) -> Reduced:
        """Return the normal equations of the common coefficients, the group's own effects eliminated.

        Rows of a stroke are equally correlated, so that their covariance is inverted by their means alone.

        Args:
            noise: Standard deviation of a row.
            stroke: Standard deviation of what the rows of a stroke share.
            deviations: Prior standard deviations of the group's own effects, shape ``(effects,)``.
        """
        ratio = self.counts * (stroke / noise) ** 2
        gram = (self.products - (self.means.T * (self.counts * ratio / (1.0 + ratio))) @ self.means) / noise**2
        design, own = slice(self.size), slice(self.size, self.size + len(deviations))
        across = gram[design, own] * deviations
        inner = np.eye(len(deviations)) + gram[own, own] * np.outer(deviations, deviations)
        covariance: Array = np.asarray(np.linalg.inv(inner))
        response = gram[own, -1] * deviations
        return Reduced(
            precision=gram[design, design] - across @ covariance @ across.T,
            moment=gram[design, -1] - across @ covariance @ response,
            square=float(gram[-1, -1] - response @ covariance @ response),
            log_determinant=float(
                2.0 * self.counts.sum() * math.log(noise) + np.log1p(ratio).sum() + np.linalg.slogdet(inner)[1]
            ),
            covariance=covariance,
            across=across,
            response=response,
            deviations=deviations,
        )


@dataclass(frozen=True)
class Reduced:
    """What one group contributes; its own effects are in units of their prior standard deviations."""

    precision: Array
    moment: Array
    square: float
    log_determinant: float
    covariance: Array  # Of its own effects, given the common coefficients
    across: Array
    response: Array
    deviations: Array


@dataclass(frozen=True)
class Posterior:
    """The common coefficients, given all groups."""

    coefficients: Array
    precision: Array
    minus_twice_likelihood: float  # Restricted, but for a constant

    def own_effect(self, part: Reduced, place: int) -> tuple[float, float]:
        """Return the posterior mean and standard deviation of one effect of a group's own, in the response's unit."""
        means = part.covariance @ (part.response - part.across.T @ self.coefficients)
        through = part.across @ part.covariance[:, place]
        variance = part.covariance[place, place] + through @ np.linalg.solve(self.precision, through)
        unit = float(part.deviations[place])
        return unit * float(means[place]), unit * math.sqrt(float(variance))


def solved(precision: Array, moment: Array, parts: Sequence[Reduced]) -> Posterior:
    """Return the common coefficients from their prior, ``precision`` times mean, and all groups."""
    precision = precision + sum(part.precision for part in parts)
    moment = moment + sum(part.moment for part in parts)
    coefficients: Array = np.asarray(np.linalg.solve(precision, moment))
    likelihood = sum(part.log_determinant + part.square for part in parts) - float(moment @ coefficients)
    return Posterior(coefficients, precision, likelihood + float(np.linalg.slogdet(precision)[1]))
