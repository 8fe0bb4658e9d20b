"""What the stages that train share: a hybrid from parameters, the device, and where they resume."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from pydantic import BaseModel

from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.import_graph import code_key

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.front_end import Design
    from cylinder_friction.params.learning import TrainingParams

RESUMED_CODE = ("cylinder_friction.stages._training", "cylinder_friction.estimators.training_plan")
"""The modules that train a hybrid: what was trained with other ones is not continued."""


def hybrid_from(
    cylinder: Cylinder, design: Design, chosen: Mapping[str, Any], training: TrainingParams, seed: int, device: str
) -> HybridEstimator:
    """Return an untrained hybrid.

    Args:
        cylinder: Its geometry.
        design: What the forest and the network are given.
        chosen: The hyperparameters that the search varies.
        training: How it is trained.
        seed: Seeds weights, dropout, batch order and the forest.
        device: ``auto``, ``cpu`` or ``cuda``.
    """
    return HybridEstimator(
        cylinder,
        design,
        Architecture(int(chosen["layers"]), int(chosen["nodes"]), chosen["dropout"], chosen["learning_rate"]),
        TrainingPlan(**training.model_dump(exclude={"forest_rows", "forest_leaf"})),
        forest_plan(chosen, training),
        seed,
        device_from(device),
    )


def forest_plan(chosen: Mapping[str, Any], training: TrainingParams) -> ForestPlan:
    return ForestPlan(
        int(chosen["forest_trees"]), int(chosen["forest_depth"]), training.forest_rows, training.forest_leaf
    )


def device_from(choice: str) -> str:
    """Return ``cuda`` or ``cpu``; ``auto`` takes CUDA where there is one.

    Raises:
        RuntimeError: ``cuda`` was asked for and there is none.
    """
    available = torch.cuda.is_available()
    if choice == "cuda" and not available:
        raise RuntimeError("device is 'cuda', but PyTorch finds no CUDA device; use 'auto' or 'cpu'")
    return "cuda" if choice != "cpu" and available else "cpu"


def resume_folder(stage: str, code: Sequence[str], *depends_on: BaseModel | Mapping[str, Any]) -> Path:
    """Return where a killed stage finds what it had finished.

    Args:
        stage: Name of the stage.
        code: The modules that do the resumed work; their names and those of all they import go into the key by content.
        depends_on: Parameters, and hashes of the data that is read.
    """
    content = [part.model_dump() if isinstance(part, BaseModel) else dict(part) for part in depends_on]
    key = hashlib.sha256(json.dumps([content, code_key(*code)], sort_keys=True).encode()).hexdigest()[:16]
    return Path(".cylinder-friction/resume") / f"{stage}-{key}"
