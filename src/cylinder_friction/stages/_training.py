"""What the stages that train share: plans from parameters, and the device."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from cylinder_friction.estimators.hybrid import ForestPlan
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan

if TYPE_CHECKING:
    from cylinder_friction.params.learning import HybridParams, TrainingParams


def training_plan(params: TrainingParams) -> TrainingPlan:
    return TrainingPlan(**params.model_dump(exclude={"forest_rows", "forest_leaf"}))


def architecture_of(params: HybridParams) -> Architecture:
    return Architecture(params.layers, params.nodes, params.dropout, params.learning_rate)


def forest_plan(params: HybridParams, training: TrainingParams) -> ForestPlan:
    return ForestPlan(params.forest_trees, params.forest_depth, training.forest_rows, training.forest_leaf)


def device_from(choice: str) -> str:
    """Return ``cuda`` or ``cpu``; ``auto`` takes CUDA where there is one.

    Raises:
        RuntimeError: ``cuda`` was asked for and there is none.
    """
    available = torch.cuda.is_available()
    if choice == "cuda" and not available:
        raise RuntimeError("train.device is 'cuda', but PyTorch finds no CUDA device; use 'auto' or 'cpu'")
    return "cuda" if choice != "cpu" and available else "cpu"
