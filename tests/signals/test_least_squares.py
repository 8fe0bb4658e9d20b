"""Least squares against NumPy, and the same digits whatever kernel BLAS would choose."""

import os
import subprocess
import sys

import numpy as np
import pytest

from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps
from cylinder_friction.signals.least_squares import least_squares

SCRIPT = """
import hashlib
import numpy as np
from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps
from cylinder_friction.signals.least_squares import least_squares

rows = np.random.default_rng(0).normal(size=(3000, 40)).cumsum(axis=1)
found = [least_squares(rows, np.sin(rows).sum(axis=1), 0.5), one_sided_savitzky_golay_taps(31, 2, 2, 0.005)]
blas = np.linalg.lstsq(rows.T @ rows, rows.T @ np.sin(rows).sum(axis=1), rcond=None)[0]
print(*(hashlib.sha256(part.tobytes()).hexdigest() for part in (np.concatenate(found), blas)))
"""


def test_it_is_the_least_squares_solution() -> None:
    generator = np.random.default_rng(1)
    rows, target = generator.normal(size=(200, 6)), generator.normal(size=200)
    np.testing.assert_allclose(least_squares(rows, target), np.linalg.lstsq(rows, target, rcond=None)[0], rtol=1e-10)
    ridge = np.linalg.solve(rows.T @ rows + 3.0 * np.eye(6), rows.T @ target)
    np.testing.assert_allclose(least_squares(rows, target, 3.0), ridge, rtol=1e-10)


def test_a_column_that_is_a_combination_of_others_gets_no_coefficient() -> None:
    rows = np.random.default_rng(2).normal(size=(100, 3))
    target = rows @ [1.0, -2.0, 0.5]
    doubled = np.column_stack([rows, rows[:, 0] + rows[:, 1], np.zeros(100)])
    np.testing.assert_allclose(least_squares(doubled, target), [1.0, -2.0, 0.5, 0.0, 0.0], atol=1e-8)


@pytest.mark.parametrize(("window", "order", "derivative"), [(21, 2, 1), (31, 2, 2), (15, 1, 1), (11, 3, 0)])
def test_savitzky_golay_taps_are_those_of_the_fit(window: int, order: int, derivative: int) -> None:
    powers = np.vander(-0.005 * np.arange(window), order + 1, increasing=True)
    expected = np.linalg.pinv(powers)[derivative] * [1.0, 1.0, 2.0][derivative]
    taps = one_sided_savitzky_golay_taps(window, order, derivative, 0.005)
    np.testing.assert_allclose(taps, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.extended
def test_digits_do_not_depend_on_the_kernel_that_blas_chooses() -> None:
    digits = []
    for kernel in ("Haswell", "Sandybridge", "Nehalem"):
        given = os.environ | {"OPENBLAS_CORETYPE": kernel}
        run = subprocess.run([sys.executable, "-c", SCRIPT], env=given, capture_output=True, text=True, check=True)
        digits.append(run.stdout.split())
    assert len({own for own, _ in digits}) == 1
