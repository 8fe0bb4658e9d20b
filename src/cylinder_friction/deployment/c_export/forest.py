"""The forest in C: eight trees are walked side by side, with as many comparisons as the deepest of the eight needs.

A node is eight bytes: threshold, distance to its first child, input. Two children are adjacent, and the pairs of their
children follow, so that two levels mostly share a cache line. Thresholds and inputs are compared as integers of the
same order, which is faster than comparing floats and gives the same result. A leaf is its own first child, holds its
value in place of a threshold, and compares it with an input below every number, so that a walk stays there. There is no
branch to predict, and every step takes the same instructions.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.realtime.forest import Forest

SIDE_BY_SIDE = 8
LARGEST_STEP = 65_535  # Largest distance to a child, a 16-bit number


@dataclass(frozen=True)
class FlatForest:
    """All trees in the order of the walk, deepest first, padded to a multiple of ``SIDE_BY_SIDE``."""

    # A node's threshold as ``ordered`` integer, a leaf's value as the bits of a float, shape ``(nodes,)``
    content: NDArray[np.int32]
    child: NDArray[np.int64]  # Distance to the first child [nodes], shape ``(nodes,)``; 0 in a leaf
    source: NDArray[np.int64]  # Input that each node compares, shape ``(nodes,)``; one past the last in a leaf
    roots: NDArray[np.int64]  # First node of each tree, shape ``(trees,)``
    depths: NDArray[np.int64]  # Comparisons of each group of eight trees, shape ``(trees / 8,)``
    inputs: int  # Number of inputs

    def nodes(self) -> Iterator[str]:
        """Yield each node as a C initializer."""
        columns = (self.content.tolist(), self.child.tolist(), self.source.tolist())
        for content, child, source in zip(*columns, strict=True):
            yield f"{{{content}, {child}u, {source}u}}"

    def operations(self) -> int:
        """Count the operations of one step: comparisons, and the sum of the leaves."""
        return int(SIDE_BY_SIDE * self.depths.sum() + len(self.roots))


def ordered(values: NDArray[np.float32]) -> NDArray[np.int32]:
    """Map numbers to integers in the same order, -0 equal to 0; C does the same to inputs."""
    bits = (values + np.float32(0.0)).view(np.int32)
    return np.where(bits < 0, bits ^ np.int32(0x7FFFFFFF), bits)


def flatten(forest: Forest) -> FlatForest:
    """Lay a forest out for the walk; raises ``ValueError`` if a tree is too large for 16-bit paths."""
    trees = sorted((_flat_tree(forest, int(root)) for root in forest.roots), key=lambda tree: -tree[3])
    nothing = (np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int64), np.full(1, forest.inputs), 0)
    trees += [nothing] * (-len(trees) % SIDE_BY_SIDE)
    sizes = np.array([len(tree[0]) for tree in trees])
    child = np.concatenate([tree[1] for tree in trees])
    if child.max() > LARGEST_STEP:
        raise ValueError(
            f"a child lies {child.max()} nodes from its parent, but expected at most {LARGEST_STEP}; "
            "fit the forest with a smaller depth"
        )
    return FlatForest(
        content=np.concatenate([tree[0] for tree in trees]),
        child=child,
        source=np.concatenate([tree[2] for tree in trees]),
        roots=np.concatenate([[0], np.cumsum(sizes)[:-1]]),
        depths=np.array([tree[3] for tree in trees[::SIDE_BY_SIDE]]),
        inputs=forest.inputs,
    )


def _flat_tree(forest: Forest, root: int) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64], int]:
    """Flatten one tree: content, child and source of its nodes, and its depth."""
    order, depth = _two_levels_together(forest, root)
    place = {node: index for index, node in enumerate(order)}
    leaf = forest.feature[order] < 0
    content = np.where(leaf, (forest.value[order] + np.float32(0.0)).view(np.int32), ordered(forest.threshold[order]))
    child = [0 if leaf[index] else place[int(forest.left[node])] - index for index, node in enumerate(order)]
    source = np.where(leaf, forest.inputs, forest.feature[order])
    return content, np.array(child), source, depth


def _two_levels_together(forest: Forest, root: int) -> tuple[list[int], int]:
    """Order a tree's nodes, each pair of children followed by the pairs below them; return its depth too."""
    order, waiting, deepest = [root], [(root, 0)], 0
    while waiting:
        parent, depth = waiting.pop()
        deepest = max(deepest, depth)
        if forest.feature[parent] < 0:
            continue
        pair = (int(forest.left[parent]), int(forest.right[parent]))
        order.extend(pair)
        deepest = max(deepest, depth + 1)
        for child in pair:
            if forest.feature[child] >= 0:
                below = (int(forest.left[child]), int(forest.right[child]))
                order.extend(below)
                waiting.extend((grandchild, depth + 2) for grandchild in reversed(below))
    return order, deepest
