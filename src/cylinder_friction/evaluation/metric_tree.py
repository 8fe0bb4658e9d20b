"""A comparison as nested numbers, for ``dvc metrics`` and for the promotion gate."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cylinder_friction.evaluation.comparison import Comparison, Score

MetricTree = dict[str, dict[str, dict[str, float]]]
"""By estimator, then by test, then by name of the number."""


def metric_tree(comparison: Comparison) -> MetricTree:
    """Returns every score: ``tree["hybrid"]["1"]["label_percent"]`` and so on.

    Names begin with ``label_`` or ``truth_``, whichever the error is measured against; ``truth_`` is there only where
    the truth is known. ``multiply_adds`` is the cost of one step. A number that is not defined is left out.
    """
    tree: MetricTree = {}
    for estimator in comparison.estimators:
        tree[estimator] = {}
        for test in comparison.tests:
            numbers = _numbers("label", comparison.label[estimator][test])
            if test in comparison.truth.get(estimator, {}):
                numbers |= _numbers("truth", comparison.truth[estimator][test])
            numbers["multiply_adds"] = float(comparison.multiply_adds[estimator])
            tree[estimator][test] = numbers
    return tree


def flat_metrics(tree: MetricTree) -> dict[str, float]:
    """Returns ``{"hybrid.test_1.label_percent": ...}``, one number each, for a run record."""
    return {
        f"{estimator}.test_{test}.{name}": value
        for estimator, tests in tree.items()
        for test, numbers in tests.items()
        for name, value in numbers.items()
    }


def _numbers(against: str, score: Score) -> dict[str, float]:
    low, high = score.interval_percent
    numbers = {f"{against}_{name}": float(value) for name, value in score.errors.to_dict().items()}
    numbers |= {
        f"{against}_percent_low": low,
        f"{against}_percent_high": high,
        f"{against}_lag_ms": 1e3 * score.lag_s,
    }
    numbers |= {f"{against}_{stratum}_mae_n": found.mae_n for stratum, found in score.strata.items()}
    return {name: value for name, value in numbers.items() if math.isfinite(value)}
