"""Least squares with the same digits on every processor: sums in a fixed order, without BLAS and LAPACK.

BLAS picks a kernel by the processor, and each kernel adds in its own order, so coefficients from two machines can
differ in their last digits.
"""

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled

NEGLIGIBLE = 1e-13
"""A column is a combination of the columns before it if they leave a smaller share of its square than this."""


def least_squares(rows: Array, target: Array, penalty: float = 0.0) -> Array:
    """Find the coefficients, shape ``(k,)``, that minimise ``|target - rows c|² + penalty |c|²``.

    A column that is a combination of those before it gets the coefficient 0.
    ``rows`` has shape ``(n, k)``, ``target`` ``(n,)``. A penalty is ridge regression (Hoerl and Kennard 1970).
    """
    gram, moment = _normal_equations(np.ascontiguousarray(rows), np.ascontiguousarray(target))
    gram[np.diag_indices_from(gram)] += penalty
    solution: Array = _solve(gram, moment)
    return solution


@compiled
def _normal_equations(rows: Array, target: Array) -> tuple[Array, Array]:
    count = rows.shape[1]
    gram, moment = np.zeros((count, count)), np.zeros(count)
    for row in range(rows.shape[0]):
        for first in range(count):
            value = rows[row, first]
            moment[first] += value * target[row]
            for second in range(first + 1):
                gram[first, second] += value * rows[row, second]
    return gram, moment


@compiled
def _solve(gram: Array, moment: Array) -> Array:
    """Solve by Cholesky factors, which overwrite the lower triangle of ``gram``; ``moment`` becomes the solution."""
    count = gram.shape[0]
    for column in range(count):
        square = gram[column, column]
        for before in range(column):
            gram[column, column] -= gram[column, before] * gram[column, before]
        free = gram[column, column] > NEGLIGIBLE * square
        pivot = np.sqrt(gram[column, column]) if free else np.inf
        for row in range(column + 1, count):
            for before in range(column):
                gram[row, column] -= gram[row, before] * gram[column, before]
            gram[row, column] /= pivot
        gram[column, column] = pivot
    for row in range(count):
        for before in range(row):
            moment[row] -= gram[row, before] * moment[before]
        moment[row] /= gram[row, row]
    for row in range(count - 1, -1, -1):
        for after in range(row + 1, count):
            moment[row] -= gram[after, row] * moment[after]
        moment[row] /= gram[row, row]
    return moment
