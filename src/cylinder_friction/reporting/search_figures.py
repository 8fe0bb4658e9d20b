"""The page of the hyperparameter search: history, importance of the hyperparameters, and error against each of them."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import optuna
from optuna.importance import FanovaImportanceEvaluator

from cylinder_friction.files.whole_files import write_text
from cylinder_friction.reporting.page import PageFigure, page_html
from cylinder_friction.tuning.search import SearchPlan, Trial, study_of
from cylinder_friction.tuning.space import SearchSpace

OBJECTIVE = "validation MAE [N]"


def write_search_page(trials: Sequence[Trial], space: SearchSpace, plan: SearchPlan, path: Path) -> None:
    """Write one self-contained HTML page with Optuna's plots of the finished trials."""
    study = study_of(trials, space)
    plots = optuna.visualization
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        figures = {
            "History": plots.plot_optimization_history(study, target_name=OBJECTIVE),
            "Error against each hyperparameter": plots.plot_slice(study, target_name=OBJECTIVE),
        }
        if len({trial.value for trial in trials if trial.value is not None}) > 2:
            evaluator = FanovaImportanceEvaluator(seed=plan.seed)
            figures["Importance"] = plots.plot_param_importances(study, evaluator=evaluator, target_name=OBJECTIVE)
    drawn = {name: PageFigure.of(figure).look(420) for name, figure in figures.items()}
    sections = {name.split()[0].lower(): name for name in figures}
    write_text(
        path, page_html("templates/search.html.j2", title="Hyperparameter search", sections=sections, figures=drawn)
    )
