"""The golden model in every shape that a step can have."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cylinder_friction.deployment.c_export.export import part_of
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.lstm import LstmWeights
from cylinder_friction.realtime.model import StepModel
from learned_offset import learning


def random_network(layers: int, nodes: int, inputs: int, seed: int) -> LstmWeights:
    generator = np.random.default_rng(seed)

    def weights(*shape: int) -> np.ndarray:
        return generator.normal(0.0, 0.5, shape).astype(np.float32)

    padded = np.zeros((layers, max(inputs, nodes), 4 * nodes), dtype=np.float32)
    padded[0, :inputs] = weights(inputs, 4 * nodes)
    padded[1:, :nodes] = weights(layers - 1, nodes, 4 * nodes)
    recurrent, bias = weights(layers, nodes, 4 * nodes), weights(layers, 4 * nodes)
    return LstmWeights(padded, recurrent, bias, weights(nodes), 0.25, inputs)


def random_forest(trees: int, depth: int, inputs: int, seed: int) -> Forest:
    """Trees of uneven depth, the last a single leaf."""
    generator = np.random.default_rng(seed)
    feature, threshold, left, right, value, roots = [], [], [], [], [], []

    def grow(below: int) -> int:
        node = len(feature)
        leaf = below == 0 or generator.random() < 0.15
        feature.append(-1 if leaf else int(generator.integers(inputs)))
        threshold.append(generator.normal(0.0, 0.7))
        value.append(generator.normal() / trees if leaf else 0.0)
        left.append(0)
        right.append(0)
        if not leaf:
            left[node] = grow(below - 1)
            right[node] = grow(below - 1)
        return node

    for tree in range(trees):
        roots.append(len(feature))
        grow(0 if tree == trees - 1 else depth)
    features, lefts, rights, starts = (np.array(each, dtype=np.int64) for each in (feature, left, right, roots))
    thresholds, values = (np.array(each, dtype=np.float32) for each in (threshold, value))
    return Forest(features, thresholds, lefts, rights, values, starts, depth, inputs)


def predicted(forest: Forest, rows: np.ndarray) -> np.ndarray:
    """The forest's output for each row of features, node by node."""
    total = np.zeros(len(rows))
    for root in forest.roots:
        node = np.full(len(rows), root)
        for _ in range(forest.depth):
            goes_left = rows[np.arange(len(rows)), forest.feature[node]] <= forest.threshold[node]
            below = np.where(goes_left, forest.left[node], forest.right[node])
            node = np.where(forest.feature[node] < 0, node, below)
        total += forest.value[node]
    return total


def _shapes() -> dict[str, Callable[[StepModel], StepModel]]:
    def hidden_only(model: StepModel) -> StepModel:
        return replace(
            model,
            network=random_network(3, 10, len(model.feature_taps), 1),
            forest=random_forest(11, 6, 10, 2),
            forest_sees="hidden",
            head_counts=False,
            base_taps=np.zeros((3, 1)),
        )

    def wide(model: StepModel) -> StepModel:
        return replace(part_of(model, "lstm"), network=random_network(1, 33, len(model.feature_taps), 3))

    def forest_alone(model: StepModel) -> StepModel:
        forest = random_forest(3, 12, len(model.feature_taps), 4)
        return replace(model, network=None, forest=forest, forest_sees="features", head_counts=False)

    return {
        "whole": lambda model: model,
        "lstm": lambda model: part_of(model, "lstm"),
        "base": lambda model: part_of(model, "base"),
        "hidden_only": hidden_only,
        "wide": wide,
        "forest_alone": forest_alone,
        "learning": learning,
        "learning_base": lambda model: part_of(learning(model), "base"),
    }


SHAPES = _shapes()
