"""A comparison as nested numbers, for ``dvc metrics`` and for the promotion gate."""

from __future__ import annotations

import math
from collections.abc import Mapping

from cylinder_friction.evaluation.comparison import Comparison, Score, mean_percent

_SHOWN = [
    *(
        f"{against}_{name}"
        for against in ("truth", "label")
        for name in ("percent", "percent_low", "percent_high", "mae_n", "lag_ms")
    ),
    "multiply_adds",
]
MetricTree = dict[str, dict[str, dict[str, float]]]
"""By estimator, then by condition, then by name of the number."""


def metric_tree(comparison: Comparison) -> MetricTree:
    """Arrange all scores as ``tree["hybrid"]["1"]["label_percent"]`` and so on.

    Names begin with ``label_`` or ``truth_``, whichever the error is measured against; ``truth_`` is there only where
    the truth is known; ``label_percent_of_<session>`` is the error in one session alone. ``multiply_adds`` is the cost
    of one step. A number that is not defined is left out.
    """
    tree: MetricTree = {}
    for estimator in comparison.estimators:
        tree[estimator] = {}
        for condition in comparison.conditions:
            numbers = _numbers("label", comparison.label[estimator], condition)
            if condition in comparison.truth.get(estimator, {}):
                numbers |= _numbers("truth", comparison.truth[estimator], condition)
            numbers["multiply_adds"] = float(comparison.multiply_adds[estimator])
            tree[estimator][condition] = numbers
    return tree


def metric_rows(tree: MetricTree) -> list[dict[str, str | float]]:
    """Return a row for each estimator in each condition, to be read: errors, their intervals, lag and cost, rounded."""
    return [
        {"estimator": estimator, "condition": condition}
        | {name: round(numbers[name], 2) for name in _SHOWN if name in numbers}
        for estimator, conditions in tree.items()
        for condition, numbers in conditions.items()
    ]


def _numbers(against: str, by_condition: Mapping[str, Score], condition: str) -> dict[str, float]:
    score = by_condition[condition]
    _, low, high = mean_percent(by_condition, [condition])
    numbers = {f"{against}_{name}": float(value) for name, value in score.errors.to_dict().items()}
    numbers |= {
        f"{against}_percent_low": low,
        f"{against}_percent_high": high,
        f"{against}_lag_ms": 1e3 * score.lag_s,
    }
    numbers |= {f"{against}_percent_of_{session}": each for session, each in score.sessions.percent.items()}
    numbers |= {f"{against}_{stratum}_mae_n": found.mae_n for stratum, found in score.strata.items()}
    return {name: value for name, value in numbers.items() if math.isfinite(value)}
