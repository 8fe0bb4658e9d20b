"""The baselines that every learned estimator has to beat, by name."""

from collections.abc import Sequence

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.forest import ForestEstimator, ForestPlan
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS


def baselines(
    cylinder: Cylinder,
    inputs: Sequence[str] = SAMPLE_COLUMNS,
    forest_plan: ForestPlan | None = None,
    seed: int = 0,
    position_load: PositionLoad | None = None,
) -> dict[str, FrictionEstimator]:
    """Return the baselines, not yet fitted.

    Args:
        cylinder: Its areas and moving mass.
        inputs: Columns of a sample; both raw pressures and the position must be among them.
        forest_plan: The random forest; None for its defaults.
        seed: Seeds the random forest.
        position_load: The load that position decides; None: a load is among the inputs, or there is none.
    """
    estimators: dict[str, FrictionEstimator] = {
        "force_balance_unfiltered": ForceBalanceEstimator(cylinder, "none", inputs),
        "force_balance_paper": ForceBalanceEstimator(cylinder, "paper", inputs),
        "force_balance_low_pass": LowPassForceBalanceEstimator(cylinder, inputs=inputs),
        "ridge": RidgeEstimator(inputs=inputs),
        "random_forest": ForestEstimator(cylinder, forest_plan, seed, inputs),
    }
    for estimator in estimators.values():
        estimator.position_load = position_load
    return estimators
