"""Regression and filtering: ridge, NARX, boosted trees, LuGre with a learned residual, the disturbance observer."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from cylinder_friction.estimators.linear import RidgeEstimator
from friction_benchmark.models.disturbance_observer import DisturbanceObserver
from friction_benchmark.models.gradient_boosting import BoostingPlan, GradientBoostingEstimator
from friction_benchmark.models.lugre_residual import LugreResidualEstimator
from friction_benchmark.models.narx import NarxEstimator
from friction_benchmark.roster.entry import (
    Making,
    OneOf,
    Range,
    RosterEntry,
    Value,
    needs_raw_pressures,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cylinder_friction.estimators.base import FrictionEstimator

_TREE_SPACE: Mapping[str, Range | OneOf] = {
    "learning_rate": Range(0.04, 0.25, logarithmic=True),
    "leaves": OneOf((15, 31, 63)),
    "loss": OneOf(("absolute_error", "squared_error")),
}
_TREE_FIRST: Mapping[str, Value] = {"learning_rate": 0.1, "leaves": 31, "loss": "absolute_error"}


def _ridge(making: Making) -> FrictionEstimator:
    """Effort cuts nothing."""
    return RidgeEstimator(int(making.choice["lags"]), float(making.choice["penalty"]), making.inputs)


def _narx(making: Making) -> FrictionEstimator:
    """Effort cuts the rows."""
    rows = max(2000, round(120_000 * making.effort))
    return NarxEstimator(making.cylinder, making.inputs, int(making.choice["terms"]), rows)


def _plan(making: Making) -> BoostingPlan:
    loss = making.choice["loss"]
    if loss not in ("absolute_error", "squared_error"):
        raise ValueError(f"expected loss 'absolute_error' or 'squared_error', but got {loss!r}")
    return BoostingPlan(
        trees=max(5, round(400 * making.effort)),
        learning_rate=float(making.choice["learning_rate"]),
        leaves=int(making.choice["leaves"]),
        loss="absolute_error" if loss == "absolute_error" else "squared_error",
        rows=max(2000, round(160_000 * making.effort)),
    )


def _gradient_boosting(making: Making) -> FrictionEstimator:
    """Effort cuts trees and rows."""
    return GradientBoostingEstimator(making.cylinder, making.inputs, _plan(making), seed=making.seed)


def _lugre_residual(making: Making) -> FrictionEstimator:
    """Effort cuts trees, rows, and LuGre's search and recordings."""
    return LugreResidualEstimator(
        making.cylinder,
        making.inputs,
        _plan(making),
        seed=making.seed,
        passive_above_m_s=cast("float", making.choice["passive_above_mm_s"]) * 1e-3,
        identification_effort=0.4 * making.effort,
        identified_on=max(2, round(16 * making.effort**0.5)),
    )


def _disturbance_observer(making: Making) -> FrictionEstimator:
    """Effort cuts the runs of its own search for the noises, and the recordings that it runs over."""
    return DisturbanceObserver(
        making.cylinder,
        making.inputs,
        evaluations=max(2, round(600 * making.effort)),
        recordings=max(2, round(24 * making.effort**0.5)),
    )


ENTRIES: tuple[RosterEntry, ...] = (
    RosterEntry(
        name="ridge",
        title="Ridge regression on lagged samples",
        family="modern",
        source="Hoerl and Kennard 1970",
        make=_ridge,
        space={
            "lags": Range(5, 60, integer=True),
            "penalty": Range(1e-3, 1e3, logarithmic=True),
        },
        first={"lags": 20, "penalty": 1.0},
        chosen="Raw samples, no features: linear in everything.",
    ),
    RosterEntry(
        name="narx",
        title="NARX, polynomial, free running",
        family="modern",
        source="Ljung 1999; Billings 2013",
        make=_narx,
        space={"terms": Range(20, 120, integer=True)},
        first={"terms": 60},
        chosen=(
            "Second degree; terms by orthogonal forward regression; its last estimate is fed back with a weight in "
            "[0, 0.98] that depends on speed, so that it is stable whatever comes in; taught in free run."
        ),
    ),
    RosterEntry(
        name="gradient_boosting",
        title="Histogram gradient boosting",
        family="modern",
        source="Friedman 2001; Ke et al. 2017",
        make=_gradient_boosting,
        space=_TREE_SPACE,
        first=_TREE_FIRST,
        chosen="Features of now, 30, 100 and 300 ms ago, and averages over 0.5 and 5 s.",
    ),
    RosterEntry(
        name="lugre_residual",
        title="LuGre and boosted trees on what it leaves",
        family="modern",
        source="Canudas de Wit et al. 1995; Psichogios and Ungar 1992",
        make=_lugre_residual,
        space={**_TREE_SPACE, "passive_above_mm_s": OneOf((0.0, 10.0, 20.0, 50.0))},
        first={**_TREE_FIRST, "passive_above_mm_s": 20.0},
        chosen=(
            "Scaled by pressure where pressures are known; with raw pressures the force balance is corrected and LuGre "
            "is a feature; while sliding fast, estimates that would feed energy are set to nought."
        ),
    ),
    RosterEntry(
        name="disturbance_observer",
        title="Kalman filter with friction and pressure-bias states",
        family="modern",
        source="Friedland 1969; Davison 1972",
        make=_disturbance_observer,
        can=needs_raw_pressures,
        chosen=(
            "Friction law over speed and pressure fitted to sliding; sensor errors measured on the training "
            "recordings; all other noises found by its own search for the least error, so nothing else is tuned."
        ),
    ),
)
