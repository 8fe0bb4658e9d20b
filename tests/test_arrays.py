"""What slides along values beside pandas."""

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import sliding_extremes


@pytest.mark.parametrize("rows", [1, 2, 3, 5, 40, 1000])
@pytest.mark.parametrize("width", [1, 2, 3, 8, 41, 79])
def test_extremes_are_those_of_pandas(rows: int, width: int) -> None:
    values = np.random.default_rng(rows).normal(size=rows)
    expected = pd.Series(values).rolling(width, 1, center=True)
    least, greatest = sliding_extremes(values, width)
    np.testing.assert_array_equal(least, expected.min())
    np.testing.assert_array_equal(greatest, expected.max())
