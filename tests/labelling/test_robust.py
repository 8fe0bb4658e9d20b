from __future__ import annotations

import numpy as np

from cylinder_friction.labelling.robust import robust_fit

DESIGN = np.column_stack([np.ones(400), np.linspace(-1.0, 1.0, 400)])


def test_columns_that_say_the_same_share_their_coefficient() -> None:
    fit = robust_fit(np.column_stack([DESIGN, DESIGN[:, 1]]), DESIGN @ np.array([2.0, 3.0]))
    np.testing.assert_allclose(fit.coefficients, [2.0, 1.5, 1.5], atol=1e-9)
