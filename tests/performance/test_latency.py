"""Peers estimate what the estimator does; a window, the output of a fresh network on the last samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from latency import WINDOW, OnnxWindow, TorchWindow, scikit_learn_forest

from cylinder_friction.estimators.front_end import FrontEndBlock
from cylinder_friction.estimators.hybrid import forest_input
from cylinder_friction.realtime.lstm import Lstm

if TYPE_CHECKING:
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.realtime.model import StepModel


def windowed(hybrid: HybridEstimator, golden_model: StepModel, samples: np.ndarray) -> np.ndarray:
    """The estimate from a fresh network over the last ``WINDOW`` rows of features, by the library's own parts."""
    assert hybrid.parts is not None
    assert golden_model.network is not None
    assert golden_model.forest is not None
    front_end = FrontEndBlock(hybrid.parts.front_end)
    features, base_n = front_end.advance(front_end.new_state(), samples)
    padded = np.concatenate([np.repeat(features[:1], WINDOW - 1, axis=0), features])
    network, result = Lstm(golden_model.network), []
    for row in range(len(samples)):
        hidden, head = network.advance(network.new_state(), padded[row : row + WINDOW])
        seen = forest_input(hybrid.design, hidden[-1:], head[-1:], features[row : row + 1])
        correction = float(head[-1]) + float(golden_model.forest.predict(seen)[0])
        result.append(base_n[row] + golden_model.target_mean_n + golden_model.target_scale_n * correction)
    return np.array(result)


@pytest.mark.parametrize("kind", [TorchWindow, OnnxWindow])
def test_a_window_estimates_what_a_fresh_network_does(
    kind: type[TorchWindow | OnnxWindow], hybrid: HybridEstimator, golden_model: StepModel, samples: np.ndarray
) -> None:
    peer = kind(golden_model)
    newtons = [peer.step(*sample) for sample in samples[:60].tolist()]
    np.testing.assert_allclose(newtons, windowed(hybrid, golden_model, samples[:60]), rtol=0.0, atol=0.05)


def test_the_forest_is_the_same_tree_for_tree(golden_model: StepModel) -> None:
    assert golden_model.forest is not None
    rows = np.random.default_rng(1).normal(size=(500, golden_model.forest.inputs)).astype(np.float32)
    forest = scikit_learn_forest(golden_model.forest)
    np.testing.assert_allclose(forest.predict(rows), golden_model.forest.predict(rows), rtol=1e-6, atol=1e-9)
    assert sum(tree.tree_.node_count for tree in forest.estimators_) == len(golden_model.forest.feature)
