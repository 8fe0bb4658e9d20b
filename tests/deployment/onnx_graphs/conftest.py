"""Small models of every shape that a step can have, and samples with everything wrong that can be."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.estimators.forest import ForestPlan, fit_forest
from cylinder_friction.realtime.lstm import LstmWeights
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.testing.golden import read_trajectories
from golden_fixtures import GOLDEN, golden_model
from learned_offset import learning, offset_samples

__all__ = ["golden_model", "model", "offset_samples", "samples"]
SHAPES = ("hybrid", "lstm", "three_layers", "forest_on_hidden", "forest_alone", "linear")
LEARNING = ("hybrid", "forest_alone", "linear")


def network(inputs: int, layers: int, nodes: int) -> LstmWeights:
    """Return random weights."""
    generator = np.random.default_rng(layers)

    def weights(*shape: int) -> np.ndarray:
        return generator.normal(0.0, 0.4, shape).astype(np.float32)

    kernels = weights(layers, max(inputs, nodes), 4 * nodes)
    kernels[0, inputs:] = 0.0
    return LstmWeights(
        kernels, weights(layers, nodes, 4 * nodes), weights(layers, 4 * nodes), weights(nodes), 0.1, inputs
    )


def shaped(golden: StepModel, shape: str) -> StepModel:
    """Return a model of one of ``SHAPES``: filters, guard and bounds of the golden one, the rest its own."""
    features = len(golden.feature_taps)
    none = replace(golden, network=None, forest=None, forest_sees="nothing", head_counts=False)
    if shape == "hybrid":
        return golden
    if shape == "lstm":
        return replace(golden, forest=None, forest_sees="nothing")
    if shape == "three_layers":
        return replace(none, network=network(features, 3, 12), head_counts=True)
    if shape == "linear":
        no_features = {"feature_limits": np.zeros(0), "feature_mean": np.zeros(0), "feature_scale": np.ones(0)}
        return replace(none, feature_taps=np.zeros((0, 3, 1)), **no_features)
    stack = network(features, 2, 8)
    inputs = features if shape == "forest_alone" else stack.nodes
    generator = np.random.default_rng(0)
    rows = generator.normal(0.0, 0.5, (500, inputs)).astype(np.float32)
    forest = fit_forest(rows, rows.sum(axis=1).astype(np.float64), ForestPlan(trees=5, depth=4, rows=500, leaf=5), 0)
    if shape == "forest_alone":
        return replace(none, forest=forest, forest_sees="features", feature_limits=np.zeros(features))
    return replace(none, network=stack, forest=forest, forest_sees="hidden")


@pytest.fixture(params=[*SHAPES, *(f"learning_{shape}" for shape in LEARNING)])
def model(request: pytest.FixtureRequest, golden_model: StepModel) -> StepModel:
    shape = request.param.removeprefix("learning_")
    plain = shaped(golden_model, shape)
    return plain if shape == request.param else learning(plain)


@pytest.fixture(scope="session")
def samples() -> np.ndarray:
    """All golden trajectories one after the other, begun with a sensor that is not there yet."""
    parts = [trajectory.samples for _, trajectory in sorted(read_trajectories(GOLDEN).items())]
    every = np.concatenate([part[:900] for part in parts])
    every[:3, 1] = np.nan
    every[3, 2] = np.inf
    every[1500:1530, 0] = 1e9
    return every
