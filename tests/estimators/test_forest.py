"""The run-time LSTM and forest against the libraries that trained them."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from sklearn.ensemble import RandomForestRegressor

from cylinder_friction.estimators.forest import ForestPlan, fit_forest, rounded_down
from cylinder_friction.estimators.onnx_files import network_from_onnx, network_to_onnx
from cylinder_friction.estimators.training import FrictionNetwork, weights_of
from cylinder_friction.estimators.training_plan import Architecture
from model_shapes import predicted


@pytest.mark.parametrize(("layers", "nodes", "inputs"), [(1, 8, 3), (2, 16, 9), (4, 8, 20)])
def test_the_lstm_equals_pytorch(layers: int, nodes: int, inputs: int) -> None:
    torch.manual_seed(layers)
    network = FrictionNetwork(Architecture(layers, nodes, 0.0, 1e-3), inputs)
    torch.nn.init.normal_(network.head.weight)
    features = np.random.default_rng(0).normal(size=(300, inputs)).astype(np.float32)
    with torch.no_grad():
        expected, _ = network(torch.from_numpy(features)[:, None])
    weights = network_from_onnx(network_to_onnx(weights_of(network)))
    _, head = weights.run(features)
    np.testing.assert_allclose(head, expected[:, 0].numpy(), atol=2e-6 * nodes)


def test_the_forest_equals_scikit_learn() -> None:
    generator = np.random.default_rng(1)
    features = generator.normal(size=(3000, 6)).astype(np.float32)
    target = np.sin(features[:, 0]) + features[:, 1] * features[:, 2] + 0.1 * generator.normal(size=3000)
    forest = fit_forest(features, target, ForestPlan(trees=12, depth=7, rows=3000, leaf=3), seed=5)
    peer = RandomForestRegressor(12, max_depth=7, min_samples_leaf=3, max_features=1 / 3, random_state=5)
    peer.fit(features, target)
    fresh = generator.normal(size=(2000, 6)).astype(np.float32)
    np.testing.assert_allclose(predicted(forest, fresh), peer.predict(fresh), atol=1e-5)
    assert forest.depth <= 7
    assert len(forest.roots) == 12


def test_rows_are_drawn_at_random() -> None:
    """The first half of the rows has another target: a forest on the first rows alone would know nothing else."""
    features = np.random.default_rng(4).normal(size=(2000, 2)).astype(np.float32)
    target = np.where(np.arange(2000) < 1000, -1.0, 1.0)
    forest = fit_forest(features, target, ForestPlan(10, 3, 400, 20), 0)
    assert abs(predicted(forest, features).mean()) < 0.2
    other = fit_forest(features, target, ForestPlan(10, 3, 400, 20), 1)
    assert not np.array_equal(forest.value, other.value)


def test_thresholds_are_rounded_down() -> None:
    thresholds = np.array([1.0 + 1e-12, 1.0 - 1e-9, 0.1, -0.1])
    single = rounded_down(thresholds)
    assert (single <= thresholds).all()
    assert (np.nextafter(single, np.float32(np.inf)) > thresholds).all()
