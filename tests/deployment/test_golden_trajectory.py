"""The golden trajectory of a served model: recorded by the compiled step, met by the graph, missed by another."""

import numpy as np
import pytest

from cylinder_friction.deployment.golden_trajectory import GoldenError, difference_n, recorded
from cylinder_friction.realtime.model import StepModel
from served_rows import served


def test_the_graph_of_an_estimator_meets_its_trajectory(small_model: StepModel) -> None:
    graph = served(small_model)
    golden = recorded(graph, small_model)
    samples = np.array(golden["samples"])
    assert samples.shape == (800, 3)
    assert (samples.min(axis=0) > graph.lower).all()
    assert (samples.max(axis=0) < graph.upper).all()
    assert np.ptp(golden["newtons"], axis=0).min() > 10.0
    assert 0.0 < difference_n(graph.run, golden) < 1e-3


def test_another_graph_misses_it(small_model: StepModel) -> None:
    golden = recorded(served(small_model), small_model)
    for change in ({"newtons": (np.array(golden["newtons"]) + 0.2).tolist()}, {"flags": [0] * 800}):
        with pytest.raises(GoldenError, match=r"on its golden trajectory it is .* N from .*; expected at most 0\.1 N"):
            difference_n(served(small_model).run, {**golden, **change})
