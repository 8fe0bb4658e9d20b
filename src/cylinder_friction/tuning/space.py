"""Where the search for the hybrid's hyperparameters looks."""

from dataclasses import dataclass

RANGES = ("learning_rate", "forest_trees", "forest_depth")
"""What is searched between a lowest and a highest value; of everything else, choices are listed."""


@dataclass(frozen=True)
class SearchSpace:
    """Choices of layers, nodes and dropout; lowest and highest learning rate (log), trees and depth."""

    layers: tuple[int, ...]
    nodes: tuple[int, ...]
    dropout: tuple[float, ...]
    learning_rate: tuple[float, float]
    forest_trees: tuple[int, int]
    forest_depth: tuple[int, int]
