"""Stage ``train``: the hybrid, with the best hyperparameters that the search found, and its LSTM alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cylinder_friction.recordings.files import read_json, whole_folder
from cylinder_friction.run_record import RunRecord, Times
from cylinder_friction.stages._stage import BEST_FILE, HYBRID_FOLDER, LSTM_FOLDER, artifacts, flat
from cylinder_friction.stages._training import (
    LearningData,
    learned_metrics,
    learning_curves,
    train_hybrid,
    write_hybrid,
)

if TYPE_CHECKING:
    from cylinder_friction.estimators.front_end import Design
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.learning import TrainParams


def run(params: Params) -> RunRecord:
    """Read the training and validation recordings and the best hyperparameters, write the hybrid and its LSTM."""
    data = LearningData.read()
    design, chosen = chosen_hybrid(params.train)
    hybrid, epochs_ms = train_hybrid("train", params, params.train, design, chosen, data)
    alone = hybrid.without_forest()
    alone.calibrate(data.train, data.calibrating, alone.cylinder)
    with whole_folder(HYBRID_FOLDER) as draft:
        write_hybrid(draft, hybrid, data, chosen)
    with whole_folder(LSTM_FOLDER) as draft:
        alone.save(draft)
    return RunRecord(
        name="train",
        params=flat(params.train)
        | {f"hybrid.{key}": value for key, value in chosen.items()}
        | {"design": design, "device": hybrid.device},
        metrics=learned_metrics({"hybrid": hybrid, "lstm": alone}, data.validation),
        curves=learning_curves(hybrid),
        artifacts=artifacts(HYBRID_FOLDER, LSTM_FOLDER),
        datasets=data.datasets,
        times=Times(0, 0, dict.fromkeys(learning_curves(hybrid), epochs_ms)),
    )


def chosen_hybrid(settings: TrainParams) -> tuple[Design, dict[str, Any]]:
    """Return the design and the hyperparameters to train: the best of the search, or those of ``train.hybrid``."""
    if not settings.use_search:
        return settings.design, settings.hybrid.model_dump()
    best: dict[str, Any] = read_json(BEST_FILE)
    return best.pop("design"), best
