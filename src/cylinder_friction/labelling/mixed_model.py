"""A linear mixed model of several groups. Each group has its own effects and strokes whose rows share an error.

Generalised least squares finds the common coefficients after the groups' own effects are eliminated. Restricted maximum
likelihood finds the variances (Henderson 1975; Patterson and Thompson 1971). That search evaluates the likelihood
often, so sums that do not depend on variances are computed once: over groups, and over strokes of equal length, since a
stroke's weight depends only on its number of rows.
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
    """Sums of products of the columns of own effects, design and response, in this order: all that the fit needs."""

    rows: int
    common: Array  # Products of design and response, shape ``(size + 1, size + 1)``
    own: Array  # Products of each group's own effects with all columns, shape ``(groups, effects, columns)``
    # The same products of the columns' sums over each stroke, added up over strokes of equal length and flattened:
    # ``(lengths, products)`` and ``(groups, lengths, products)``, padded with zeros for groups with fewer lengths
    common_strokes: Array
    own_strokes: Array
    lengths: Array  # Number of rows of the strokes in ``common_strokes``, shape ``(lengths,)``
    own_lengths: Array  # Number of rows of the strokes in ``own_strokes``, shape ``(groups, lengths)``
    stroke_counts: Array  # Number of strokes of each of ``lengths``, shape ``(lengths,)``

    @classmethod
    def of(cls, columns: Array, effects: int, rows: NDArray[np.int64], stroke: NDArray[np.int64]) -> Self:
        """Sum the evidence of groups whose rows follow one another; ``rows`` counts those of each, shape ``(groups,)``.

        ``columns``, shape ``(rows, columns)``, are those of a group's own ``effects``, then of the common coefficients,
        then the response. ``stroke`` numbers each row's stroke, ascending; no stroke spans two groups.
        """
        first, ends, size = np.flatnonzero(np.diff(stroke, prepend=-1)), np.cumsum(rows), columns.shape[1] - effects
        counts, sums = np.diff(first, append=len(stroke)), np.add.reduceat(columns, first)
        lengths, length, stroke_counts = np.unique(counts, return_inverse=True, return_counts=True)
        alike = [sums[length == each, effects:] for each in range(len(lengths))]
        pairs, pair = np.unique(np.searchsorted(ends, first, "right") * (len(stroke) + 1) + counts, return_inverse=True)
        group, own_length = np.divmod(pairs, len(stroke) + 1)
        place = np.arange(len(pairs)) - np.searchsorted(group, group)
        own_lengths = np.zeros((len(rows), place.max(initial=0) + 1))
        own_lengths[group, place] = own_length
        own_strokes = np.zeros((*own_lengths.shape, effects, columns.shape[1]))
        np.add.at(own_strokes, (group[pair], place[pair]), sums[:, :effects, None] * sums[:, None, :])
        return cls(
            rows=len(columns),
            common=columns[:, effects:].T @ columns[:, effects:],
            own=np.stack([each[:, :effects].T @ each for each in np.split(columns, ends[:-1])]),
            common_strokes=np.array([each.T @ each for each in alike]).reshape(len(lengths), size**2),
            own_strokes=own_strokes.reshape(*own_lengths.shape, -1),
            lengths=lengths.astype(np.float64),
            own_lengths=own_lengths,
            stroke_counts=stroke_counts.astype(np.float64),
        )

    def reduced(self, noise: float, stroke: float, deviations: Array) -> Reduced:
        """Build the normal equations of the common coefficients, with the groups' own effects eliminated.

        ``noise`` is the standard deviation of a row, and ``stroke`` that of the error which the rows of a stroke share:
        they are equally correlated, so their sums suffice to invert their covariance. ``deviations`` are the prior ones
        of the groups' own effects, shape ``(groups, effects)``.
        """
        ratio, effects = (stroke / noise) ** 2, deviations.shape[1]
        growth, own_weights = 1.0 + ratio * self.lengths, ratio / (1.0 + ratio * self.own_lengths)
        normal = self.common - ((ratio / growth) @ self.common_strokes).reshape(self.common.shape)
        own = self.own - (own_weights[:, None, :] @ self.own_strokes).reshape(self.own.shape)
        own *= (deviations / noise**2)[:, :, None]
        own[:, :, :effects] *= deviations[:, None, :]
        log_determinant = 2.0 * self.rows * math.log(noise) + float(self.stroke_counts @ np.log(growth))
        for place in range(effects):  # Cholesky's decomposition of all groups at once; without rounding, pivots >= 1
            pivot = np.maximum(1.0 + own[:, place, place], 1.0)
            log_determinant += float(np.log(pivot).sum())
            own[:, place] /= np.sqrt(pivot)[:, None]
            own[:, place + 1 :] -= own[:, place, place + 1 : effects, None] * own[:, place, None]
        across = own[:, :, effects:].reshape(-1, len(normal))
        normal = normal / noise**2 - across.T @ across
        return Reduced(normal, log_determinant, deviations[:, -1] / np.sqrt(pivot), own[:, -1, effects:])


@dataclass(frozen=True)
class Reduced:
    """Summed contributions of the groups, and the last of each group's own effects given the common coefficients."""

    normal: Array  # Precision of the coefficients; the moment in the last row and column, the square in the corner
    log_determinant: float
    spread: Array  # Standard deviation of the last effect, shape ``(groups,)``
    last: Array  # Products of that effect with design and response, over ``spread``, shape ``(groups, size + 1)``


@dataclass(frozen=True)
class Posterior:
    """Posterior of the common coefficients, given all groups."""

    coefficients: Array
    precision: Array
    minus_twice_likelihood: float  # Minus twice the restricted log-likelihood, up to a constant

    @property
    def variances(self) -> Array:
        """Variances of the coefficients."""
        return np.diag(np.linalg.inv(self.precision))

    @classmethod
    def mixed(cls, posteriors: Sequence[Self], weights: Array) -> Self:
        """Build the posterior with mean and covariance of several, of which one is true, with these ``weights``."""
        means = np.array([each.coefficients for each in posteriors])
        mean = np.average(means, axis=0, weights=weights)
        covariances = [np.linalg.inv(each.precision) for each in posteriors]
        off = means - mean
        covariance = np.average(covariances + off[:, :, None] * off[:, None, :], axis=0, weights=weights)
        return cls(mean, np.asarray(np.linalg.inv(covariance)), math.nan)

    def last_effect(self, parts: Reduced) -> tuple[Array, Array]:
        """Compute posterior means and standard deviations of the last of the groups' own effects."""
        across = parts.last[:, :-1]
        variance = 1.0 + (across.T * np.linalg.solve(self.precision, across.T)).sum(axis=0)
        return parts.spread * (parts.last[:, -1] - across @ self.coefficients), parts.spread * np.sqrt(variance)


def solved(precision: Array, moment: Array, parts: Reduced) -> Posterior:
    """Solve for the common coefficients; ``precision`` and ``moment``, precision times mean, are their prior."""
    precision, moment = precision + parts.normal[:-1, :-1], moment + parts.normal[:-1, -1]
    coefficients: Array = np.asarray(np.linalg.solve(precision, moment))
    likelihood = parts.log_determinant + float(parts.normal[-1, -1] - moment @ coefficients)
    return Posterior(coefficients, precision, likelihood + float(np.linalg.slogdet(precision)[1]))
