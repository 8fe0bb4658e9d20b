"""Stage ``baselines``: the paper's hybrid, its LSTM alone, and simpler baselines that the hybrid has to beat."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.execution.progress import progress
from cylinder_friction.files.whole_files import whole_folder
from cylinder_friction.stages._stage import BASELINES_FOLDER, PAPER_HYBRID_FOLDER
from cylinder_friction.stages._training import (
    LearningData,
    hybrid_from,
    plan_from,
    train_hybrid,
    training_record,
    write_hybrid,
)

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.params.checking import Params
    from cylinder_friction.run_record import RunRecord


def run(params: Params) -> RunRecord:
    """Read the training and validation recordings; write the paper's hybrid and every baseline."""
    settings, cylinder, data = params.baselines, params.cylinder, LearningData.read()
    chosen = settings.hybrid.model_dump()
    paper = hybrid_from(cylinder, "paper", chosen, settings, data)
    train_hybrid("baselines", paper, chosen, settings, data)
    trees = plan_from(ForestPlan, {**settings.training.model_dump(), **chosen}, "forest_")
    named: dict[str, FrictionEstimator] = dict(
        baselines(cylinder, data.inputs, trees, settings.seed, data.position_load)
    )
    for estimator in progress(named.values(), "train baselines", unit="estimator"):
        estimator.fit(data.train)
        if estimator.has_step:  # only a step learns the offset; an estimator of another package may have no step
            estimator.offset = data.tracker
    named["paper_lstm"] = paper.without_forest()
    for estimator in named.values():
        if estimator.has_step:  # it may be registered and exported, so it needs guard and bounds
            estimator.calibrate(data.train, data.calibrating, cylinder)
    with whole_folder(PAPER_HYBRID_FOLDER) as draft:
        write_hybrid(draft, paper, data, chosen)
    with whole_folder(BASELINES_FOLDER) as draft:
        for name, baseline in named.items():
            baseline.save(draft / name)
    estimators, folders = {"paper_hybrid": paper, **named}, (PAPER_HYBRID_FOLDER, BASELINES_FOLDER)
    return training_record("baselines", settings, {}, paper, estimators, data, folders)
