"""What slides along values beside pandas; medians and quantiles beside NumPy."""

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import median, quantile, sliding_extremes


@pytest.mark.parametrize("rows", [1, 2, 3, 5, 40, 1000])
@pytest.mark.parametrize("width", [1, 2, 3, 8, 41, 79])
def test_extremes_are_those_of_pandas(rows: int, width: int) -> None:
    values = np.random.default_rng(rows).normal(size=rows)
    expected = pd.Series(values).rolling(width, 1, center=True)
    least, greatest = sliding_extremes(values, width)
    np.testing.assert_array_equal(least, expected.min())
    np.testing.assert_array_equal(greatest, expected.max())


@pytest.mark.parametrize("rows", [1, 2, 3, 40, 41, 1000])
@pytest.mark.parametrize("digits", [1, 9])
def test_medians_and_quantiles_are_those_of_numpy(rows: int, digits: int) -> None:
    values = np.random.default_rng(rows).normal(size=rows).round(digits)
    assert median(values) == np.median(values)
    for share in (0.0, 0.01, 0.1, 0.5, 0.95, 0.99, 1.0):
        assert quantile(values, share) == np.quantile(values, share)
