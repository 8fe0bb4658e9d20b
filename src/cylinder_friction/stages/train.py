"""Stage ``train``: the hybrid, with the best hyperparameters that the search found, and its LSTM alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cylinder_friction.files.whole_files import read_json, whole_folder
from cylinder_friction.stages._stage import BEST_FILE, HYBRID_FOLDER, LSTM_FOLDER
from cylinder_friction.stages._training import LearningData, hybrid_from, train_hybrid, training_record, write_hybrid

if TYPE_CHECKING:
    from cylinder_friction.estimators.front_end import Design
    from cylinder_friction.params.checking import Params
    from cylinder_friction.run_record import RunRecord, Scalar


def run(params: Params) -> RunRecord:
    """Read the training and validation recordings and the best hyperparameters; write the hybrid and its LSTM."""
    settings, data = params.train, LearningData.read()
    given = {"design": settings.design, **settings.hybrid.model_dump()}
    chosen: dict[str, Any] = read_json(BEST_FILE) if settings.use_search else given
    design: Design = chosen.pop("design")
    hybrid = hybrid_from(params.cylinder, design, chosen, settings, data, settings.lag_s)
    train_hybrid("train", hybrid, chosen, settings, data)
    alone = hybrid.without_forest()
    alone.calibrate(data.train, data.calibrating, params.cylinder)
    with whole_folder(HYBRID_FOLDER) as draft:
        write_hybrid(draft, hybrid, data, chosen)
    with whole_folder(LSTM_FOLDER) as draft:
        alone.save(draft)
    found: dict[str, Scalar] = {"design": design} | {f"hybrid.{key}": value for key, value in chosen.items()}
    estimators = {"hybrid": hybrid, "lstm": alone}
    return training_record("train", settings, found, hybrid, estimators, data, (HYBRID_FOLDER, LSTM_FOLDER))
