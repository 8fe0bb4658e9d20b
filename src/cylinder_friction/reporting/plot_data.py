"""The data of ``dvc plots``: small CSV files."""

import math
import re

import pandas as pd

from cylinder_friction.evaluation.analysis import Analysis
from cylinder_friction.evaluation.comparison import mean_percent


def plot_tables(analysis: Analysis) -> dict[str, str]:
    """Return CSV text by file name: learning curves, friction over time, errors by condition, residual histograms."""
    tables = {"errors_by_condition.csv": _errors(analysis)}
    for name, curve in analysis.curves.items():
        columns = {key: getattr(curve, key) for key in ("epoch", "train_mae_n", "validation_mae_n")}
        tables[f"learning_curve_{name}.csv"] = pd.DataFrame(columns)
    for part in analysis.excerpts:
        lines = {"time_s": part.time_s} | {f"{name}_n": values for name, values in part.lines_n.items()}
        in_a_file_name = re.sub(r"[^A-Za-z0-9.-]+", "_", part.condition)
        tables[f"friction_over_time_condition_{in_a_file_name}.csv"] = pd.DataFrame(lines).dropna()
    for name, counted in analysis.histograms.items():
        tables[f"residuals_{name}.csv"] = pd.DataFrame(
            {
                "residual_n": counted.centres_n,
                "density_per_n": counted.density,
                "normal_density_per_n": counted.normal_density,
            }
        )
    return {name: table.to_csv(index=False, float_format="%.6g", lineterminator="\n") for name, table in tables.items()}


def _errors(analysis: Analysis) -> pd.DataFrame:
    comparison = analysis.comparison
    rows = []
    for name in comparison.estimators:
        for condition in comparison.conditions:
            score = comparison.label[name][condition]
            _, low, high = mean_percent(comparison.label[name], [condition])
            true = comparison.truth.get(name, {}).get(condition)
            rows.append(
                {
                    "case": f"{name} · {condition}",
                    "estimator": name,
                    "condition": condition,
                    "label_percent": score.errors.percent,
                    "label_percent_low": low,
                    "label_percent_high": high,
                    "label_mae_n": score.errors.mae_n,
                    "truth_percent": true.errors.percent if true else math.nan,
                }
            )
    return pd.DataFrame(rows)
