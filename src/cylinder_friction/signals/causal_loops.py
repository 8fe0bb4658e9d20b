"""The loops over samples of causal filters, in compiled code."""

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled

FEW_ROWS = 16
"""Fewer rows than this are filtered row by row: a stream's single step gains nothing from going tap by tap."""


@compiled
def fir(taps: Array, padded: Array) -> Array:
    """Compute the outputs of an ``FirFilter``, shape ``(n, m)``, from ``length - 1`` earlier inputs and ``n`` more."""
    outputs, inputs, length = taps.shape
    rows = padded.shape[0] - length + 1
    result = np.zeros((rows, outputs))
    if rows < FEW_ROWS:
        for row in range(rows):
            for output in range(outputs):
                total = 0.0
                for source in range(inputs):
                    for lag in range(length):
                        tap = taps[output, source, lag]
                        if tap != 0.0:
                            total += tap * padded[row + length - 1 - lag, source]
                result[row, output] = total
        return result
    columns, line = np.ascontiguousarray(padded.T), np.empty(rows)
    for output in range(outputs):
        line[:] = 0.0
        # Tap by tap over all rows, so that the compiler vectorises over rows; each row still sums in the same order.
        for source in range(inputs):
            for lag in range(length):
                tap = taps[output, source, lag]
                if tap != 0.0:
                    seen = columns[source, length - 1 - lag : length - 1 - lag + rows]
                    for row in range(rows):
                        line[row] += tap * seen[row]
        result[:, output] = line
    return result


@compiled
def low_pass(weight: float, last: Array, inputs: Array) -> Array:
    """Compute the outputs of an ``ExponentialLowPass``, of the inputs' shape; ``last`` becomes the last output."""
    result = np.empty_like(inputs)
    for row in range(inputs.shape[0]):
        for column in range(inputs.shape[1]):
            last[column] += weight * (inputs[row, column] - last[column])
            result[row, column] = last[column]
    return result
