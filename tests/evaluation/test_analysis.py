"""The analysis of a comparison."""

from __future__ import annotations

import pytest

from cylinder_friction.evaluation.analysis import analyse


def test_an_unknown_main_estimator_is_refused_by_name(compared, curves):
    with pytest.raises(KeyError, match="'hybrid' was not compared"):
        analyse(compared(ridge=1.0, lugre=2.0), "hybrid", "lugre", curves, 2.0, 20)
