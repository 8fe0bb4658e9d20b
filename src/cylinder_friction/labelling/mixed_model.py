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
    """The products of each group's columns: of design, own effects and response. All else follows from them."""

    products: Array  # Summed over rows, shape ``(groups, columns, columns)``
    means: Array  # Of each stroke, shape ``(groups, strokes, columns)``; zeros where a group has fewer
    counts: Array  # Rows of each stroke, shape ``(groups, strokes)``
    size: int  # Columns of the design

    @classmethod
    def of(cls, groups: Sequence[tuple[Array, Array, Array, NDArray[np.int64]]]) -> Self:
        """Return the evidence of groups of ``n`` rows each.

        Args:
            groups: Columns of the common coefficients, shape ``(n, size)``, those of the group's own effects, shape
                ``(n, effects)``, what is explained, shape ``(n,)``, and the stroke of each row, counted from 0.
        """
        strokes = max((int(stroke.max()) + 1 for *_, stroke in groups if len(stroke)), default=0)
        columns = [np.column_stack(group[:3]) for group in groups]
        products = np.stack([each.T @ each for each in columns])
        counts, sums = np.zeros((len(groups), strokes)), np.zeros((len(groups), strokes, products.shape[1]))
        for place, (each, (*_, stroke)) in enumerate(zip(columns, groups, strict=True)):
            counts[place] = np.bincount(stroke, minlength=strokes)
            np.add.at(sums[place], stroke, each)
        return cls(products, sums / np.maximum(counts, 1.0)[:, :, None], counts, groups[0][0].shape[1])

    def some(self, groups: slice) -> Evidence:
        """Return the evidence of some of the groups."""
        return Evidence(self.products[groups], self.means[groups], self.counts[groups], self.size)

    def reduced(self, noise: float, stroke: float, deviations: Array) -> Reduced:
        """Return the normal equations of the common coefficients, the groups' own effects eliminated.

        Rows of a stroke are equally correlated, so that their covariance is inverted by their means alone.

        Args:
            noise: Standard deviation of a row.
            stroke: Standard deviation of what the rows of a stroke share.
            deviations: Prior standard deviations of the groups' own effects, shape ``(groups, effects)``.
        """
        ratio = self.counts * (stroke / noise) ** 2
        weighted = self.means * (self.counts * ratio / (1.0 + ratio))[:, :, None]
        gram = (self.products - weighted.transpose(0, 2, 1) @ self.means) / noise**2
        design, own = slice(self.size), slice(self.size, self.size + deviations.shape[1])
        across = gram[:, design, own] * deviations[:, None, :]
        inner = np.eye(deviations.shape[1]) + gram[:, own, own] * deviations[:, :, None] * deviations[:, None, :]
        covariance: Array = np.asarray(np.linalg.inv(inner))
        response = gram[:, own, -1] * deviations
        through = across @ covariance
        explained = (covariance @ response[:, :, None])[:, :, 0]
        rows = 2.0 * self.counts.sum() * math.log(noise)
        return Reduced(
            precision=(gram[:, design, design] - through @ across.transpose(0, 2, 1)).sum(axis=0),
            moment=(gram[:, design, -1] - (through @ response[:, :, None])[:, :, 0]).sum(axis=0),
            square=float((gram[:, -1, -1] - (response * explained).sum(axis=1)).sum()),
            log_determinant=float(rows + np.log1p(ratio).sum() + np.linalg.slogdet(inner)[1].sum()),
            covariance=covariance,
            across=across,
            response=response,
            deviations=deviations,
        )


@dataclass(frozen=True)
class Reduced:
    """What the groups contribute, summed, and their own effects in units of their prior standard deviations."""

    precision: Array
    moment: Array
    square: float
    log_determinant: float
    covariance: (
        Array  # Of each group's own effects, given the common coefficients, shape ``(groups, effects, effects)``
    )
    across: Array  # Shape ``(groups, size, effects)``
    response: Array  # Shape ``(groups, effects)``
    deviations: Array  # Shape ``(groups, effects)``


@dataclass(frozen=True)
class Posterior:
    """The common coefficients, given all groups."""

    coefficients: Array
    precision: Array
    minus_twice_likelihood: float  # Restricted, but for a constant

    def own_effect(self, parts: Reduced, place: int) -> tuple[Array, Array]:
        """Return posterior means and standard deviations of one of the groups' own effects, in the response's unit."""
        explained = parts.response - np.einsum("gde,d->ge", parts.across, self.coefficients)
        row = parts.covariance[:, place]
        through = np.einsum("gde,ge->dg", parts.across, row)
        variance = row[:, place] + (through * np.linalg.solve(self.precision, through)).sum(axis=0)
        unit = parts.deviations[:, place]
        return unit * (row * explained).sum(axis=1), unit * np.sqrt(variance)


def solved(precision: Array, moment: Array, parts: Reduced) -> Posterior:
    """Return the common coefficients from their prior, ``precision`` times mean, and all groups."""
    precision, moment = precision + parts.precision, moment + parts.moment
    coefficients: Array = np.asarray(np.linalg.solve(precision, moment))
    likelihood = parts.log_determinant + parts.square - float(moment @ coefficients)
    return Posterior(coefficients, precision, likelihood + float(np.linalg.slogdet(precision)[1]))
