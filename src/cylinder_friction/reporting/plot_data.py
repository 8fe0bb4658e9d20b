"""The data of ``dvc plots``: small CSV files, whose names and columns are the same in every project."""

import math

import pandas as pd

from cylinder_friction.evaluation.analysis import Analysis
from cylinder_friction.evaluation.views import LearningCurve


def plot_tables(analysis: Analysis) -> dict[str, str]:
    """Write the CSV text of each plot, by file name.

    All plots show ``main``, the estimator that the comparison is about, so that two experiments overlay: its errors by
    condition and session, its learning curve and residuals, and friction over time, the conditions' excerpts one after
    the other.
    """
    comparison, main = analysis.comparison, analysis.main
    curve = analysis.curves.get(main, LearningCurve([], [], [], 0))
    counted = analysis.histograms[main]
    scores, reference = (comparison.truth, "truth") if comparison.truth else (comparison.label, "label")
    frames = {
        "errors_by_condition": pd.DataFrame(
            {"condition": condition, "error_percent": score.errors.percent, "mae_n": score.errors.mae_n}
            for condition, score in scores[main].items()
        ).assign(against=reference),
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
