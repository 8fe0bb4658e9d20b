"""What the stages that train share: a hybrid from parameters, trained, resumed and written."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import torch
from pydantic import BaseModel
from tqdm import tqdm

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, Checkpoint, TrainingPlan
from cylinder_friction.evaluation.validation import mean_absolute_error_n
from cylinder_friction.import_graph import code_key
from cylinder_friction.params.learning import TrainParams
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.recordings.files import read_json, write_json
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.run_record import Dataset, now_ms
from cylinder_friction.stages._datasets import datasets
from cylinder_friction.stages._stage import (
    CHOSEN_FILE,
    ESTIMATORS_FILE,
    PROCESSED_FOLDERS,
    TRAINING_DATA_FILE,
    cylinder_from,
)

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.estimators.front_end import Design
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.learning import BaselinesParams, TrainingParams

NETWORK_MAE = "network_mae_n"
"""Group of the network's error by epoch, without the forest, among a run's curves."""
RESUMED_CODE = ("cylinder_friction.stages._training", "cylinder_friction.estimators.training_plan")
"""The modules that train a hybrid: what was trained with other ones is not continued."""


@dataclass(frozen=True)
class LearningData:
    """The recordings to train on, and those of other sessions that stop the training and that calibrate the bounds.

    Without sessions for calibration, those for validation do that too.
    """

    train: list[Recording]
    validation: list[Recording]
    calibration: list[Recording]
    inputs: tuple[str, ...]  # Columns of a sample
    position_load: PositionLoad | None  # The load that position decides; None where it does not
    tracker: OffsetTracker | None  # How an estimator learns the sensors' offset; None where none was identified
    datasets: dict[str, Dataset]  # Each folder read, by role

    @classmethod
    def read(cls) -> Self:
        folders = {role: PROCESSED_FOLDERS[role] for role in ("train", "validation", "calibration")}
        train, validation, calibration = (read_recordings(folder) for folder in folders.values())
        given = read_json(ESTIMATORS_FILE)
        load, tracker = given["position_load"], given["offset_tracker"]
        return cls(
            train,
            validation,
            calibration,
            tuple(given["inputs"]),
            None if load is None else PositionLoad.from_dict(load),
            None if tracker is None else OffsetTracker.from_dict(tracker),
            datasets(folders),
        )

    @property
    def hashes(self) -> dict[str, str]:
        """The content hash of each folder read, by role."""
        return {role: each.sha256 for role, each in self.datasets.items()}

    @property
    def calibrating(self) -> list[Recording]:
        """The recordings that bounds are calibrated on."""
        return self.calibration or self.validation

    def sources(self) -> dict[str, dict[str, str]]:
        """Return the hash of every source file, by role and recording."""
        return {
            role: {recording.name: recording.metadata.source_sha256 for recording in recordings}
            for role, recordings in (
                ("train", self.train),
                ("validation", self.validation),
                ("calibration", self.calibration),
            )
        }


def train_hybrid(
    stage: str,
    params: Params,
    section: TrainParams | BaselinesParams,
    design: Design,
    chosen: Mapping[str, Any],
    data: LearningData,
) -> tuple[HybridEstimator, list[int]]:
    """Return a trained hybrid and when each epoch ended [ms since 1970]; a run that was killed is gone on with.

    Args:
        stage: Name of the stage.
        params: Of the pipeline, for the cylinder.
        section: Training, seed and device of the stage.
        design: What the forest and the network are given.
        chosen: The hyperparameters that a search would vary.
        data: What is learned from.
    """
    training = section.training
    cylinder, seeds = cylinder_from(params.cylinder), (section.seed, section.device)
    lag_s = section.lag_s if isinstance(section, TrainParams) else 0.0
    estimator = hybrid_from(cylinder, design, chosen, training, *seeds, data, lag_s)
    own = {"design": design, "seed": section.seed, "lag_s": lag_s}
    folder = resume_folder(stage, RESUMED_CODE, params.cylinder, chosen, training, data.hashes, own)
    ended_ms: list[int] = []
    with tqdm(total=training.epochs, desc=f"train {design} hybrid", unit="epoch", disable=None) as bar:

        def after_epoch(epoch: int, train_mae_n: float, validation_mae_n: float) -> None:
            ended_ms.append(now_ms())
            bar.set_postfix_str(f"training {train_mae_n:.2f} N, validation {validation_mae_n:.2f} N")
            bar.update(epoch - bar.n)

        estimator.fit(data.train, data.validation, data.calibration, Checkpoint(folder), after_epoch)
    return estimator, ended_ms


def write_hybrid(folder: Path, estimator: HybridEstimator, data: LearningData, chosen: Mapping[str, Any]) -> None:
    """Write a hybrid with its hyperparameters, its learning curve and the hashes of the files it was trained on."""
    estimator.save(folder)
    write_json(folder / CHOSEN_FILE, dict(chosen))
    curve = estimator.learning_curve
    write_json(
        folder / "learning_curve.json",
        {
            "epoch": list(range(1, len(curve.train_mae) + 1)),
            "train_mae_n": curve.train_mae,
            "validation_mae_n": curve.validation_mae,
            "best_epoch": curve.best_epoch,
        },
    )
    write_json(folder / TRAINING_DATA_FILE, data.sources())


def learned_metrics(estimators: Mapping[str, FrictionEstimator], validation: Sequence[Recording]) -> dict[str, float]:
    """Return each estimator's validation error [N] and cost of a step [multiply-adds]."""
    return {
        f"validation_mae_n/{name}": mean_absolute_error_n(each, validation) for name, each in estimators.items()
    } | {f"multiply_adds/{name}": float(each.multiply_adds()) for name, each in estimators.items()}


def learning_curves(estimator: HybridEstimator) -> dict[str, list[float]]:
    """Return the errors of the network after each epoch [N], on training and on validation recordings."""
    curve = estimator.learning_curve
    return {f"{NETWORK_MAE}/train": curve.train_mae, f"{NETWORK_MAE}/validation": curve.validation_mae}


def hybrid_from(
    cylinder: Cylinder,
    design: Design,
    chosen: Mapping[str, Any],
    training: TrainingParams,
    seed: int,
    device: str,
    data: LearningData,
    lag_s: float = 0.0,
) -> HybridEstimator:
    """Return an untrained hybrid.

    Args:
        cylinder: Its geometry.
        design: What the forest and the network are given.
        chosen: The hyperparameters that the search varies.
        training: How it is trained.
        seed: Seeds weights, dropout, batch order and the forest.
        device: ``auto``, ``cpu`` or ``cuda``.
        data: Its inputs, the load that position decides, and how it learns the sensors' offset.
        lag_s: How long after a moment its friction is estimated [s].
    """
    return HybridEstimator(
        cylinder,
        design,
        Architecture(int(chosen["layers"]), int(chosen["nodes"]), chosen["dropout"], chosen["learning_rate"]),
        TrainingPlan(**training.model_dump(exclude={"forest_rows", "forest_leaf"})),
        forest_plan(chosen, training),
        seed,
        device_from(device),
        inputs=data.inputs,
        tracker=data.tracker,
        lag_s=lag_s,
        position_load=data.position_load,
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
