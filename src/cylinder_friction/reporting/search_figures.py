"""The search as a page: history, importance of each hyperparameter, parallel coordinates."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import optuna
from optuna.importance import FanovaImportanceEvaluator

from cylinder_friction.recordings.files import write_text
from cylinder_friction.tuning.search import study_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import plotly.graph_objects as go

    from cylinder_friction.tuning.search import SearchPlan, SearchSpace, Trial

OBJECTIVE = "validation MAE [N]"


def write_search_page(trials: Sequence[Trial], space: SearchSpace, plan: SearchPlan, path: Path) -> None:
    """Write one self-contained HTML page with Optuna's plots of the finished trials."""
    study = study_of(trials, space)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        figures = {
            "history": optuna.visualization.plot_optimization_history(study, target_name=OBJECTIVE),
            "parallel": optuna.visualization.plot_parallel_coordinate(study, target_name=OBJECTIVE),
        }
        if _importance_can_be_told(trials):
            figures["importance"] = optuna.visualization.plot_param_importances(
                study, evaluator=FanovaImportanceEvaluator(seed=plan.seed), target_name=OBJECTIVE
            )
    body = "\n".join(_div(name, figure, first=name == "history") for name, figure in figures.items())
    page = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Search</title><body>{body}</body></html>'
    write_text(path, page)


def _importance_can_be_told(trials: Sequence[Trial]) -> bool:
    values = {trial.value for trial in trials if trial.value is not None}
    return len(values) > 2


def _div(name: str, figure: go.Figure, first: bool) -> str:
    html: str = figure.to_html(
        full_html=False, include_plotlyjs=first, div_id=name, config={"displaylogo": False, "showSendToCloud": False}
    )
    return html
