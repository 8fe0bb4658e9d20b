"""Stage ``train``: the default hybrid, the paper's hybrid, and the baselines that they have to beat."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.training_plan import Checkpoint
from cylinder_friction.evaluation.validation import mean_absolute_error_n
from cylinder_friction.realtime.guard import largest_friction_n
from cylinder_friction.recordings.files import hash_of, read_json, whole_folder, write_json
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import (
    BASELINES_FOLDER,
    BEST_FILE,
    CHOSEN_FILE,
    HYBRID_FOLDER,
    PAPER_HYBRID_FOLDER,
    PROCESSED_FOLDERS,
    artifacts,
    cylinder_from,
    flat,
)
from cylinder_friction.stages._training import RESUMED_CODE, forest_plan, hybrid_from, resume_folder

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.estimators.front_end import Design
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.estimators.training_plan import LearningCurve
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.learning import TrainingParams, TrainParams
    from cylinder_friction.recordings.recording import Recording

REAL_TIME_BASELINES = ("random_forest", "lstm", "paper_lstm")
"""What can be exported to other runtimes beside the hybrids, and so needs guard and bounds."""


def run(params: Params) -> RunRecord:
    """Read the training and validation recordings and the best hyperparameters, write every trained estimator."""
    train = read_recordings(PROCESSED_FOLDERS["train"])
    validation = read_recordings(PROCESSED_FOLDERS["validation"])
    datasets = {role: hash_of(PROCESSED_FOLDERS[role]) for role in ("train", "validation")}
    settings = params.train
    design, chosen = chosen_hybrid(settings)
    hybrid = _trained(params, design, chosen, settings.training, train, validation, datasets)
    paper = _trained(
        params, "paper", settings.paper_hybrid.model_dump(), settings.paper_training, train, validation, datasets
    )
    others = _baselines(params, train) | {"lstm": hybrid.without_forest(), "paper_lstm": paper.without_forest()}
    for name in REAL_TIME_BASELINES:
        others[name].calibrate(largest_friction_n(train), validation)
    for folder, estimator in ((HYBRID_FOLDER, hybrid), (PAPER_HYBRID_FOLDER, paper)):
        with whole_folder(folder) as draft:
            estimator.save(draft)
            _write_curve(draft / "learning_curve.json", estimator.learning_curve)
            write_json(draft / "training_data.json", _sources(train, validation))
            if estimator is hybrid:
                write_json(draft / CHOSEN_FILE.name, chosen)
    with whole_folder(BASELINES_FOLDER) as draft:
        for name, baseline in others.items():
            baseline.save(draft / name)
    named: dict[str, FrictionEstimator] = {"hybrid": hybrid, "paper_hybrid": paper, **others}
    return RunRecord(
        name="train",
        params=flat(settings) | {f"chosen.{key}": value for key, value in chosen.items()},
        metrics={f"{name}_validation_mae_n": mean_absolute_error_n(each, validation) for name, each in named.items()}
        | {f"{name}_multiply_adds": float(each.multiply_adds()) for name, each in named.items()},
        curves={
            f"{name}_{part}_mae_n": getattr(each.learning_curve, f"{part}_mae")
            for name, each in (("hybrid", hybrid), ("paper_hybrid", paper))
            for part in ("train", "validation")
        },
        artifacts=artifacts(HYBRID_FOLDER, PAPER_HYBRID_FOLDER, BASELINES_FOLDER),
        datasets=datasets,
    )


def chosen_hybrid(settings: TrainParams) -> tuple[Design, dict[str, Any]]:
    """Return the design and the hyperparameters to train: the best of the search, or those of ``train.hybrid``."""
    if not settings.use_search:
        return settings.design, settings.hybrid.model_dump()
    best: dict[str, Any] = read_json(BEST_FILE)
    return best.pop("design"), best


def _trained(
    params: Params,
    design: Design,
    chosen: Mapping[str, Any],
    training: TrainingParams,
    train: Sequence[Recording],
    validation: Sequence[Recording],
    datasets: dict[str, str],
) -> HybridEstimator:
    settings = params.train
    estimator = hybrid_from(cylinder_from(params.cylinder), design, chosen, training, settings.seed, settings.device)
    own = {"design": design, "seed": settings.seed}
    folder = resume_folder("train", RESUMED_CODE, params.cylinder, chosen, training, datasets, own)
    with tqdm(total=training.epochs, desc=f"train {design} hybrid", unit="epoch", disable=None) as bar:

        def after_epoch(epoch: int, train_mae_n: float, validation_mae_n: float) -> None:
            bar.set_postfix_str(f"training {train_mae_n:.2f} N, validation {validation_mae_n:.2f} N")
            bar.update(epoch - bar.n)

        estimator.fit(train, validation, Checkpoint(folder), after_epoch)
    return estimator


def _baselines(params: Params, train: Sequence[Recording]) -> dict[str, FrictionEstimator]:
    cylinder = cylinder_from(params.cylinder)
    trees = forest_plan(params.train.paper_hybrid.model_dump(), params.train.paper_training)
    made = baselines(cylinder, forest_plan=trees, seed=params.train.seed)
    for estimator in tqdm(made.values(), desc="train baselines", unit="estimator", disable=None):
        estimator.fit(train)
    return made


def _write_curve(path: Path, curve: LearningCurve) -> None:
    write_json(
        path,
        {
            "epoch": list(range(1, len(curve.train_mae) + 1)),
            "train_mae_n": curve.train_mae,
            "validation_mae_n": curve.validation_mae,
            "best_epoch": curve.best_epoch,
        },
    )


def _sources(train: Sequence[Recording], validation: Sequence[Recording]) -> dict[str, dict[str, str]]:
    """Return the hash of every source file used for training and validation."""
    return {
        role: {recording.name: recording.metadata.source_sha256 for recording in recordings}
        for role, recordings in (("train", train), ("validation", validation))
    }
