"""The data of ``dvc plots``: small CSV files with the same names and columns in every project."""

import math

import pandas as pd

from cylinder_friction.evaluation.analysis import Analysis
from cylinder_friction.evaluation.comparison import Scores
from cylinder_friction.evaluation.reported import Reference, error_metrics
from cylinder_friction.evaluation.views import LearningCurve


def plot_tables(analysis: Analysis) -> dict[str, str]:
    """Write the CSV text of each plot, by file name.

    All plots show ``main``, the estimator that the comparison is about, so that two experiments overlay: its errors by
    condition with their mean, and by session, its learning curve and residuals, and friction over time, the
    conditions' excerpts one after the other.
    """
    comparison, main = analysis.comparison, analysis.main
    curve = analysis.curves.get(main, LearningCurve([], [], [], 0))
    counted = analysis.histograms[main]
    scores: Scores = comparison.truth or comparison.label
    reference: Reference = "truth" if comparison.truth else "label"
    own = {condition: score.errors for condition, score in scores[main].items()}
    named = error_metrics({condition: errors.percent for condition, errors in own.items()}, reference)
    means = {"condition": "mean", "error_percent": named.get(f"{reference}_error_percent/mean", math.nan)}
    rows = [{"condition": name, "error_percent": each.percent, "mae_n": each.mae_n} for name, each in own.items()]
    frames = {
        "errors_by_condition": pd.DataFrame([*rows, means]).assign(against=reference),
        "errors_by_session": pd.DataFrame(
            {"session": session, "condition": condition, "error_percent": percent}
            for condition, score in scores[main].items()
            for session, percent in score.sessions.percent.items()
        ).assign(against=reference),
        "learning_curve": pd.DataFrame(
            {key: getattr(curve, key) for key in ("epoch", "train_mae_n", "validation_mae_n")}
        ),
        "residuals": pd.DataFrame({"residual_n": counted.centres_n, "density_per_n": counted.density}),
        "friction_over_time": _excerpts(analysis),
    }
    return {
        f"{name}.csv": frame.to_csv(index=False, float_format="%.6g", lineterminator="\n")
        for name, frame in frames.items()
    }


def _excerpts(analysis: Analysis) -> pd.DataFrame:
    names = {"label": "label_n", "truth": "truth_n", analysis.rival: "rival_n", analysis.main: "estimate_n"}
    pieces, begins_s = [], 0.0
    for part in analysis.excerpts:
        lines = {column: part.lines_n.get(name, math.nan) for name, column in names.items()}
        piece = pd.DataFrame({"time_s": part.time_s - part.time_s[0] + begins_s, "condition": part.condition, **lines})
        pieces.append(piece[piece["estimate_n"].notna()])
        begins_s += float(part.time_s[-1] - part.time_s[0])
    return pd.concat(pieces)
