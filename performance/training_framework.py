"""A stored network and forest as the PyTorch module and the scikit-learn forest that they were trained as."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from sklearn.ensemble import RandomForestRegressor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.realtime.forest import Forest
    from cylinder_friction.realtime.lstm import LstmWeights

    Single = NDArray[np.float32]

TORCH_ORDER = (0, 2, 3, 1)
"""Where PyTorch's gates i, f, g, o stand in ONNX's order i, o, f, c."""


class TorchNetwork(torch.nn.Module):
    """LSTM layers and a linear head, batch first."""

    def __init__(self, weights: LstmWeights) -> None:
        super().__init__()
        self.lstm = torch.nn.LSTM(weights.inputs, weights.nodes, weights.layers, batch_first=True)
        self.head = torch.nn.Linear(weights.nodes, 1)
        self.load_state_dict({name: torch.from_numpy(array) for name, array in _named(weights).items()})
        self.eval()

    def forward(self, window: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the last hidden state, shape ``(batch, nodes)``, and the head, for ``(batch, time, features)``."""
        hidden, _ = self.lstm(window)
        last = hidden[:, -1]
        return last, self.head(last)


def scikit_learn_forest(forest: Forest) -> RandomForestRegressor:
    """Return a forest of the same trees, every node at the same place, for one job."""
    inputs, trees = np.zeros((2, forest.inputs), dtype=np.float32), len(forest.roots)
    result = RandomForestRegressor(n_estimators=trees, n_jobs=1).fit(inputs, np.zeros(2))
    ends = [*forest.roots[1:].tolist(), len(forest.feature)]
    for tree, begin, end in zip(result.estimators_, forest.roots.tolist(), ends, strict=True):
        make, arguments, empty = tree.tree_.__reduce__()
        tree.tree_ = make(*arguments)  # a fresh one: only that takes room for its nodes
        tree.tree_.__setstate__(_tree_state(forest, begin, end, empty, trees))
    return result


def _named(weights: LstmWeights) -> dict[str, Single]:
    named: dict[str, Single] = {
        "head.weight": weights.head[None, :].copy(),
        "head.bias": np.array([weights.head_bias], dtype=np.float32),
    }
    for layer in range(weights.layers):
        inputs = weights.inputs if layer == 0 else weights.nodes
        named[f"lstm.weight_ih_l{layer}"] = _torch_rows(weights.input[layer, :inputs].T)
        named[f"lstm.weight_hh_l{layer}"] = _torch_rows(weights.recurrent[layer].T)
        named[f"lstm.bias_ih_l{layer}"] = _torch_rows(weights.bias[layer])
        named[f"lstm.bias_hh_l{layer}"] = np.zeros_like(weights.bias[layer])
    return named


def _torch_rows(rows: Single) -> Single:
    gates = np.split(rows, 4)
    return np.ascontiguousarray(np.concatenate([gates[place] for place in TORCH_ORDER]))


def _tree_state(forest: Forest, begin: int, end: int, empty: dict[str, Any], trees: int) -> dict[str, Any]:
    """Return the state of one tree; scikit-learn marks with -1 for no child and -2 for no feature."""
    part = slice(begin, end)
    leaf = forest.feature[part] < 0
    nodes = np.zeros(end - begin, dtype=empty["nodes"].dtype)
    nodes["left_child"] = np.where(leaf, -1, forest.left[part] - begin)
    nodes["right_child"] = np.where(leaf, -1, forest.right[part] - begin)
    nodes["feature"] = np.where(leaf, -2, forest.feature[part])
    nodes["threshold"] = np.where(leaf, -2.0, forest.threshold[part])
    nodes["n_node_samples"] = nodes["weighted_n_node_samples"] = 1
    values = forest.value[part].astype(np.float64).reshape(-1, 1, 1) * trees
    return {**empty, "max_depth": forest.depth, "node_count": end - begin, "nodes": nodes, "values": values}
