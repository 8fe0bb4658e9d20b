"""What ``dvc plots`` draws: small CSV files."""

from __future__ import annotations

import csv
import io
import math
import re
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from cylinder_friction.evaluation.analysis import Analysis


def plot_tables(analysis: Analysis) -> dict[str, str]:
    """Return CSV text by file name: learning curves, friction over time, errors by test, residual histograms."""
    tables = {f"learning_curve_{name}.csv": _learning_curve(analysis, name) for name in analysis.curves}
    for index, part in enumerate(analysis.excerpts):
        in_a_file_name = re.sub(r"[^A-Za-z0-9.-]+", "_", part.condition)
        tables[f"friction_over_time_test_{in_a_file_name}.csv"] = _excerpt(analysis, index)
    tables["errors_by_condition.csv"] = _errors(analysis)
    for name, counted in analysis.histograms.items():
        tables[f"residuals_{name}.csv"] = _csv(
            ("residual_n", "density_per_n", "normal_density_per_n"),
            zip(counted.centres_n, counted.density, counted.normal_density, strict=True),
        )
    return tables


def _learning_curve(analysis: Analysis, name: str) -> str:
    curve = analysis.curves[name]
    rows = zip(curve.epoch, curve.train_mae_n, curve.validation_mae_n, strict=True)
    return _csv(("epoch", "train_mae_n", "validation_mae_n"), rows)


def _excerpt(analysis: Analysis, index: int) -> str:
    part = analysis.excerpts[index]
    columns = np.column_stack([part.time_s, *part.lines_n.values()])
    return _csv(("time_s", *(f"{name}_n" for name in part.lines_n)), columns[np.isfinite(columns).all(axis=1)])


def _errors(analysis: Analysis) -> str:
    comparison = analysis.comparison
    rows = []
    for name in comparison.estimators:
        for condition in comparison.conditions:
            score = comparison.label[name][condition]
            true = comparison.truth.get(name, {}).get(condition)
            truth = true.errors.percent if true else math.nan
            rows.append((name, condition, score.errors.percent, *score.interval_percent, score.errors.mae_n, truth))
    head = ("estimator", "condition", "label_percent", "label_percent_low", "label_percent_high", "label_mae_n")
    return _csv((*head, "truth_percent"), rows)


def _csv(head: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)
