"""Steps that all training stages share: build, train, resume, write and record a hybrid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training import device_from
from cylinder_friction.estimators.training_plan import Architecture, Checkpoint, TrainingPlan
from cylinder_friction.evaluation.validation import mean_absolute_error_n
from cylinder_friction.execution.progress import progress
from cylinder_friction.files.whole_files import json_hash, read_json, write_json
from cylinder_friction.import_graph import code_key
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import (
    CHOSEN_FILE,
    ESTIMATORS_FILE,
    PROCESSED_FOLDERS,
    TRAINING_DATA_FILE,
    artifacts,
    datasets,
    flat,
)

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.estimators.front_end import Design
    from cylinder_friction.params.learning import BaselinesParams, LearningParams, TrainParams
    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.run_record import Dataset, Scalar

Plan = TypeVar("Plan", Architecture, TrainingPlan, ForestPlan)
NETWORK_MAE = "network_mae_n"
"""Group, among a run's curves, of the network's error by epoch without the forest."""
RESUMED_CODE = ("cylinder_friction.stages._training", "cylinder_friction.estimators.training_plan")
"""Modules that train a hybrid; a training is resumed only if their code is unchanged."""


@dataclass(frozen=True)
class LearningData:
    """Recordings to train on, recordings to stop the training (validation), and recordings to calibrate the bounds.

    The three come from different sessions. Without calibration sessions, the validation sessions calibrate the bounds.
    """

    train: list[Recording]
    validation: list[Recording]
    calibration: list[Recording]
    inputs: tuple[str, ...]  # Columns of a sample
    position_load: PositionLoad | None  # Load that depends on position, if any
    tracker: OffsetTracker | None  # Tracker by which an estimator learns the sensors' offset; None if not identified
    datasets: dict[str, Dataset]  # Each folder that was read, by role

    @classmethod
    def read(cls) -> Self:
        folders = {role: PROCESSED_FOLDERS[role] for role in ("train", "validation", "calibration")}
        recordings = {role: read_stored(folder) for role, folder in folders.items()}
        given = read_json(ESTIMATORS_FILE)
        load, tracker = given["position_load"], given["offset_tracker"]
        return cls(
            **recordings,
            inputs=tuple(given["inputs"]),
            position_load=None if load is None else PositionLoad.from_dict(load),
            tracker=None if tracker is None else OffsetTracker.from_dict(tracker),
            datasets=datasets(folders),
        )

    @property
    def hashes(self) -> dict[str, str]:
        """Content hash of each folder that was read, by role."""
        return {role: each.md5 for role, each in self.datasets.items()}

    @property
    def calibrating(self) -> list[Recording]:
        """Recordings to calibrate the bounds."""
        return self.calibration or self.validation


def hybrid_from(
    cylinder: Cylinder,
    design: Design,
    chosen: Mapping[str, Any],
    settings: LearningParams,
    data: LearningData,
    lag_s: float = 0.0,
) -> HybridEstimator:
    """Make an untrained hybrid. ``chosen`` may name any field of its plans and overrides ``settings.training``."""
    given = {**settings.training.model_dump(), **chosen}
    return HybridEstimator(
        cylinder,
        design,
        plan_from(Architecture, given),
        plan_from(TrainingPlan, given),
        plan_from(ForestPlan, given, "forest_"),
        settings.seed,
        device_from(settings.device),
        inputs=data.inputs,
        tracker=data.tracker,
        lag_s=lag_s,
        position_load=data.position_load,
    )


def plan_from(kind: type[Plan], given: Mapping[str, Any], prefix: str = "") -> Plan:
    """Make a plan from the settings named after its fields; other fields keep their defaults."""
    return kind(**{each.name: given[prefix + each.name] for each in fields(kind) if prefix + each.name in given})


def train_hybrid(
    stage: str, hybrid: HybridEstimator, chosen: Mapping[str, Any], settings: LearningParams, data: LearningData
) -> None:
    """Train a hybrid from ``hybrid_from``; resume a training that was killed."""
    assert hybrid.cylinder is not None
    own = {"design": hybrid.design, "seed": settings.seed, "lag_s": hybrid.lag_s}
    depends_on = (flat(hybrid.cylinder.to_dict()), chosen, settings.training.model_dump(), data.hashes, own)
    checkpoint = Checkpoint(resume_folder(stage, RESUMED_CODE, *depends_on))
    with progress(words=f"train {hybrid.design} hybrid", total=settings.training.epochs, unit="epoch") as bar:

        def after_epoch(epoch: int, train_mae_n: float, validation_mae_n: float) -> None:
            bar.set_postfix_str(f"training {train_mae_n:.2f} N, validation {validation_mae_n:.2f} N")
            bar.update(epoch - bar.n)

        hybrid.fit(data.train, data.validation, data.calibration, checkpoint, after_epoch)


def write_hybrid(folder: Path, estimator: HybridEstimator, data: LearningData, chosen: Mapping[str, Any]) -> None:
    """Write a hybrid with its hyperparameters, its learning curve and the hashes of its training files."""
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
    roles = {"train": data.train, "validation": data.validation, "calibration": data.calibration}
    sources = {role: {each.name: each.metadata.source_sha256 for each in own} for role, own in roles.items()}
    write_json(folder / TRAINING_DATA_FILE, sources)


def training_record(
    stage: str,
    settings: TrainParams | BaselinesParams,
    found: Mapping[str, Scalar],
    hybrid: HybridEstimator,
    estimators: Mapping[str, FrictionEstimator],
    data: LearningData,
    folders: Sequence[Path],
) -> RunRecord:
    """Make the record of a stage that trained ``hybrid`` and made ``estimators``; ``found`` adds parameters.

    The metrics are each estimator's validation error [N] and cost of a step [multiply-adds].
    """
    curve = hybrid.learning_curve
    curves = {f"{NETWORK_MAE}/train": curve.train_mae, f"{NETWORK_MAE}/validation": curve.validation_mae}
    metrics = {}
    for name, each in estimators.items():
        metrics[f"validation_mae_n/{name}"] = mean_absolute_error_n(each, data.validation)
        metrics[f"multiply_adds/{name}"] = float(each.multiply_adds())
    return RunRecord(
        name=stage,
        params={**flat(settings), **found, "device": hybrid.device},
        metrics=metrics,
        note="" if hybrid.gain is None else hybrid.gain.in_words(),
        curves=curves,
        artifacts=artifacts(*folders),
        datasets=data.datasets,
    )


def resume_folder(stage: str, code: Sequence[str], *depends_on: Mapping[str, Any]) -> Path:
    """Find the folder in which a killed stage keeps its finished work.

    ``code`` names the modules that do the resumed work. The folder's key includes the content of these modules and of
    all modules that they import.
    """
    key = json_hash([[dict(part) for part in depends_on], code_key(*code)])
    return Path(".cylinder-friction/resume") / f"{stage}-{key[:16]}"
