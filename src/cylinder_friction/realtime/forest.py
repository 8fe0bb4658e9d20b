"""A forest of regression trees as plain arrays."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Forest:
    """A forest of binary regression trees; a row goes left if ``feature <= threshold``."""

    feature: NDArray[np.int64]  # Feature that each node compares, shape ``(nodes,)``; -1 in a leaf
    threshold: NDArray[np.float32]  # Shape ``(nodes,)``, single precision, as the features are
    left: NDArray[np.int64]  # Next node if the feature is at most the threshold, shape ``(nodes,)``
    right: NDArray[np.int64]  # Next node if it is larger, shape ``(nodes,)``
    value: NDArray[np.float32]  # A leaf's output, divided by the number of trees, shape ``(nodes,)``
    roots: NDArray[np.int64]  # Index of each tree's first node, shape ``(trees,)``
    depth: int  # Longest path from a root to a leaf
    inputs: int  # Number of features

    @classmethod
    def of(
        cls,
        feature: NDArray[Any],
        threshold: NDArray[Any],
        left: NDArray[Any],
        right: NDArray[Any],
        value: NDArray[Any],
        roots: NDArray[Any],
        inputs: int,
    ) -> Self:
        """Build a forest from its nodes; the children of leaves are ignored."""
        depth, level = 0, roots
        while len(inner := level[feature[level] >= 0]):
            depth, level = depth + 1, np.concatenate([left[inner], right[inner]])
        nodes, lower, upper, first = (array.astype(np.int64) for array in (feature, left, right, roots))
        return cls(nodes, threshold.astype(np.float32), lower, upper, value.astype(np.float32), first, depth, inputs)

    def comparisons(self) -> int:
        """Count the comparisons of one row at worst."""
        return len(self.roots) * self.depth
