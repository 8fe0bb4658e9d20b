"""Terms of a NARX model: which there are, choosing them by the error that each explains, and running them.

A term is a product of two columns, of which column 0 is one: ``(0, 0)`` is the constant, ``(i, 0)`` linear, ``(i, j)``
of second degree.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numba
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Terms = NDArray[np.int64]

CLIP = 6.0
"""Standard deviations at which a column is cut off: every term is bounded whatever the sensors give."""
COLLINEAR = 1e-8


def candidate_terms(present: int, columns: int) -> Terms:
    """Return, shape ``(m, 2)``: constant, every column, and every product of two of the first ``present`` columns."""
    linear = [(column, 0) for column in range(columns + 1)]
    products = [(first, second) for first in range(1, present + 1) for second in range(1, first + 1)]
    return np.array(linear + products, dtype=np.int64)


def chosen_terms(gram: Array, moment: Array, count: int) -> Terms:
    """Return the indices of ``count`` terms, each the one that explains most of what those before it left.

    Forward regression with orthogonal least squares by the error reduction ratio (Chen, Billings and Luo 1989; FROLS
    in Billings 2013), on products of regressors alone: choosing a term takes its share out of all others.

    Args:
        gram: Regressors' products with one another, shape ``(m, m)``.
        moment: Their products with the target, shape ``(m,)``.
        count: At most so many; fewer where the rest is collinear with those chosen.
    """
    left, explained = gram.copy(), moment.copy()
    own = np.maximum(np.diag(gram).copy(), 1e-300)
    free = np.ones(len(moment), dtype=np.bool_)
    chosen: list[int] = []
    for _ in range(min(count, len(moment))):
        usable = free & (np.diag(left) > COLLINEAR * own)
        if not usable.any():
            break
        gain = np.where(usable, explained**2 / np.where(usable, np.diag(left), 1.0), -1.0)
        best = int(np.argmax(gain))
        direction = left[:, best] / left[best, best]
        explained = explained - direction * explained[best]
        left = left - np.outer(direction, left[best])
        free[best] = False
        chosen.append(best)
    return np.array(chosen, dtype=np.int64)


@numba.njit(cache=True)
def poles(creep: Array, at_rest: float, sliding: float) -> Array:
    """Return how much of the last estimate is kept, shape ``(n,)``, for ``creep = v / (|v| + v_c)``, in [-1, 1]."""
    return at_rest + (sliding - at_rest) * np.minimum(np.abs(creep), 1.0)


@numba.njit(cache=True)
def filtered_terms(columns: Array, terms: Terms, kept: Array, every: int) -> Array:
    """Return every ``every``-th row, from the last of the first ``every`` on, of terms behind the model's own poles.

    Args:
        columns: Shape ``(n, c)``, column 0 one.
        terms: Shape ``(m, 2)``.
        kept: From ``poles``, shape ``(n,)``.
        every: Rows a row that is returned.
    """
    result = np.empty((columns.shape[0] // every, terms.shape[0]))
    state = np.zeros(terms.shape[0])
    for row in range(columns.shape[0]):
        for term in range(terms.shape[0]):
            value = columns[row, terms[term, 0]] * columns[row, terms[term, 1]]
            state[term] = value if row == 0 else kept[row] * state[term] + (1.0 - kept[row]) * value
        if (row + 1) % every == 0:
            result[row // every] = state
    return result


@numba.njit(cache=True)
def free_run(columns: Array, terms: Terms, weights: Array, kept: Array, state: Array) -> Array:
    """Return the model's output, fed with its own last output, shape ``(n,)``; ``state`` is that, NaN at first."""
    result = np.empty(columns.shape[0])
    for row in range(columns.shape[0]):
        total = 0.0
        for term in range(terms.shape[0]):
            total += weights[term] * columns[row, terms[term, 0]] * columns[row, terms[term, 1]]
        state[0] = total if np.isnan(state[0]) else kept[row] * state[0] + (1.0 - kept[row]) * total
        result[row] = state[0]
    return result
