"""An estimator's errors by condition for the promotion gate, the registry and MLflow's charts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

Reference = Literal["label", "truth"]
"""The reference of errors."""


def reported_errors(conditions: Mapping[str, Mapping[str, float]]) -> tuple[Reference, dict[str, float]]:
    """Look up an estimator's error by condition [percent of mean |friction|], and its reference.

    The reference is true friction if that is known in every condition, so that an estimator nearer to friction is not
    refused for reproducing less of the label's noise. An error that the report lacks is NaN.
    """
    reference: Reference = "truth" if all("truth_percent" in each for each in conditions.values()) else "label"
    return reference, {
        name: numbers.get(f"{reference}_percent", math.nan) for name, numbers in sorted(conditions.items())
    }


def error_metrics(errors_percent: Mapping[str, float], reference: Reference) -> dict[str, float]:
    """List errors by condition, and their mean, as metrics of a run that name their reference.

    Errors that are NaN are left out.
    """
    group = f"{reference}_error_percent"
    metrics = {f"{group}/mean": math.fsum(errors_percent.values()) / max(len(errors_percent), 1)}
    metrics |= {f"{group}/condition_{name}": value for name, value in errors_percent.items()}
    return {name: value for name, value in metrics.items() if math.isfinite(value)}
