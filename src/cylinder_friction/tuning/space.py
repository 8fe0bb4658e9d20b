"""The space in which the hybrid's hyperparameters are searched."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

RANGES = ("learning_rate", "forest_trees", "forest_depth")
"""Hyperparameters searched between a lowest and a highest value; all others have a list of choices."""

_Count = Annotated[int, Field(ge=1)]
_Some = Field(min_length=1)
_Rate = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


@dataclass(frozen=True)
class SearchSpace:
    """Choices of layers, nodes and dropout; lowest and highest learning rate (log), trees and depth.

    Raises:
        ValueError: A range's lowest value is above its highest.
    """

    layers: Annotated[Sequence[_Count], _Some]
    nodes: Annotated[Sequence[_Count], _Some]
    dropout: Annotated[Sequence[Annotated[float, Field(ge=0.0, lt=1.0)]], _Some]
    learning_rate: tuple[_Rate, _Rate]
    forest_trees: tuple[_Count, _Count]
    forest_depth: tuple[_Count, _Count]

    def __post_init__(self) -> None:
        for key in RANGES:
            lowest, highest = getattr(self, key)
            if lowest > highest:
                raise ValueError(f"{key}: lowest {lowest} is above highest {highest}; swap them")
