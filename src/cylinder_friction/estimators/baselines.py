"""The baselines that every learned estimator has to beat, by name."""

from collections.abc import Sequence

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.entry_points import own_class, own_kinds
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
    """Make the baselines, not yet fitted, by name, followed by the estimators that other packages register.

    Use them with ``compare`` to see what a learned estimator gains over the force balance, its low-pass, ridge
    regression and a random forest. Registered estimators are made from the cylinder alone: ``Class(cylinder)``.

    Args:
        cylinder: Its areas and moving mass.
        inputs: Columns of a sample; both raw pressures and the position must be among them.
        forest_plan: The random forest; None for its defaults.
        seed: Seeds the random forest.
        position_load: The load that position decides; None: a load is among the inputs, or there is none.

    Raises:
        ValueError: A registered class cannot be imported or made, or has the name of a baseline.

    Example:
        >>> from cylinder_friction.estimators.baselines import baselines
        >>> fitted = {name: estimator.fit(train) for name, estimator in baselines(cylinder).items() if name == "ridge"}
        >>> print(cf.compare(fitted, test))  # doctest: +ELLIPSIS
        Mean absolute error against the label...
    """
    estimators: dict[str, FrictionEstimator] = {
        "force_balance_unfiltered": ForceBalanceEstimator(cylinder, "none", inputs),
        "force_balance_paper": ForceBalanceEstimator(cylinder, "paper", inputs),
        "force_balance_low_pass": LowPassForceBalanceEstimator(cylinder, inputs=inputs),
        "ridge": RidgeEstimator(inputs=inputs),
        "random_forest": ForestEstimator(cylinder, forest_plan, seed, inputs),
    }
    for kind, entry in own_kinds().items():
        if kind in estimators:
            raise ValueError(f"{entry.value}: its kind {kind!r} is the name of a baseline; choose another")
        estimators[kind] = own_class(entry)(cylinder)
    for estimator in estimators.values():
        estimator.position_load = position_load
    return estimators
