"""The forest of the C: eight trees walked side by side, every walk as long as the deepest of the eight.

A node is eight bytes: threshold, way to its first child, input. Its children lie next to each other, and a pair of
children beside its own children's pairs, so that two levels mostly share a cache line. Thresholds and inputs are
compared as integers of the same order, which is quicker than comparing floats and never differs from it. A leaf is its
own first child, holds its value in place of a threshold, and compares it with an input below every number: a walk that
has arrived stays. There is no branch to predict, and a step takes the same instructions whatever the sample.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.realtime.forest import Forest

SIDE_BY_SIDE = 8
LARGEST_STEP = 65_535  # The way to a child is a 16-bit number


@dataclass(frozen=True)
class FlatForest:
    """All trees in the order in which C walks them, deepest first, padded to a multiple of ``SIDE_BY_SIDE``."""

    # A node's threshold as ``ordered`` integer, a leaf's value as the bits of a float, shape ``(nodes,)``
    content: NDArray[np.int32]
    child: NDArray[np.int64]  # How many nodes further on the first child is, shape ``(nodes,)``; 0 in a leaf
    source: NDArray[np.int64]  # Which input each node compares, shape ``(nodes,)``; one past the last in a leaf
    roots: NDArray[np.int64]  # Where each tree begins, shape ``(trees,)``
    depths: NDArray[np.int64]  # Comparisons of each eight trees, shape ``(trees / 8,)``
    inputs: int  # Number of inputs

    def nodes(self) -> Iterator[str]:
        """Yield each node as a C initializer."""
        columns = (self.content.tolist(), self.child.tolist(), self.source.tolist())
        for content, child, source in zip(*columns, strict=True):
            yield f"{{{content}, {child}u, {source}u}}"

    def operations(self) -> int:
        """Return the comparisons of one step, and the sum of the leaves."""
        return int(SIDE_BY_SIDE * self.depths.sum() + len(self.roots))


def ordered(values: NDArray[np.float32]) -> NDArray[np.int32]:
    """Return integers in the same order as the given numbers, -0 equal to 0; C does the same to inputs."""
    bits = (values + np.float32(0.0)).view(np.int32)
    return np.where(bits < 0, bits ^ np.int32(0x7FFFFFFF), bits)


def flatten(forest: Forest) -> FlatForest:
    """Return a forest laid out for the walk; raises ``ValueError`` if a tree is too large for 16-bit ways."""
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
    """Return content, child and source of one tree's nodes, and its depth."""
    order, depth = _two_levels_together(forest, root)
    place = {node: index for index, node in enumerate(order)}
    leaf = forest.feature[order] < 0
    content = np.where(leaf, (forest.value[order] + np.float32(0.0)).view(np.int32), ordered(forest.threshold[order]))
    child = [0 if leaf[index] else place[int(forest.left[node])] - index for index, node in enumerate(order)]
    source = np.where(leaf, forest.inputs, forest.feature[order])
    return content, np.array(child), source, depth


def _two_levels_together(forest: Forest, root: int) -> tuple[list[int], int]:
    """Return a tree's nodes, each pair of children followed by the pairs below them, and the tree's depth."""
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
