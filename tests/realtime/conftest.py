"""Small models of every design as step models, and a stream."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.forest import ForestEstimator, ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.recording import Recording

PLAN = TrainingPlan(epochs=1, patience=1, sequence_length=200, burn_in=20, batch_size=4)
FOREST = ForestPlan(trees=5, depth=4, rows=2000, leaf=5)
PRESSURES = ("pressure_1_pa", "pressure_2_pa")
DESIGNS: dict[str, Callable[[Cylinder], FrictionEstimator]] = {
    "force_balance": lambda cylinder: HybridEstimator(
        cylinder, "force_balance", Architecture(1, 8, 0.0, 3e-3), PLAN, FOREST
    ),
    "paper": lambda cylinder: HybridEstimator(cylinder, "paper", Architecture(3, 8, 0.3, 1e-3), PLAN, FOREST),
    "lstm": lambda cylinder: HybridEstimator(cylinder, "force_balance", Architecture(2, 7, 0.1, 3e-3), PLAN, None),
    "paper_lstm": lambda cylinder: HybridEstimator(cylinder, "paper", Architecture(1, 5, 0.0, 3e-3), PLAN, None),
    "position_alone": lambda cylinder: HybridEstimator(
        cylinder, architecture=Architecture(1, 8, 0.0, 3e-3), plan=PLAN, forest_plan=FOREST, inputs=("position_m",)
    ),
    "full": lambda cylinder: HybridEstimator(
        cylinder, "full", Architecture(1, 6, 0.0, 3e-3), PLAN, FOREST, inputs=("position_m", *PRESSURES)
    ),
    "random_forest": lambda cylinder: ForestEstimator(cylinder, FOREST),
    "ridge": lambda cylinder: RidgeEstimator(lags=6),
    "paper_force_balance": lambda cylinder: ForceBalanceEstimator(cylinder, "paper"),
}
LEARNS_OFFSET = "learns_offset"


@pytest.fixture(scope="session", params=[*sorted(DESIGNS), LEARNS_OFFSET])
def designed(
    request: pytest.FixtureRequest,
    cylinder: Cylinder,
    labelled_recordings: list[Recording],
    offset_recordings: list[Recording],
) -> FrictionEstimator:
    """An estimator of each design, and one that learns the sensors' offset."""
    if request.param == LEARNS_OFFSET:
        return DESIGNS["force_balance"](cylinder).fit(offset_recordings)
    return DESIGNS[request.param](cylinder).fit(labelled_recordings)


@pytest.fixture
def stream(small_model: StepModel) -> RealTimeStream:
    """The small hybrid, with any force taken for friction."""
    return RealTimeStream(replace(small_model, guard=replace(small_model.guard, force_weights=())))
