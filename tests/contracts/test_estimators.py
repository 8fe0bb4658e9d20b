"""Every estimator keeps the contract, on several sets of sensors."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.analytical import AnalyticalEstimator, scaled_effort
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.forest import ForestEstimator, ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.loading import KINDS
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.friction_models.catalogue import model_named
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.testing.estimator_contract import CHECKS, Case, ContractError, check_estimator

PLAN = TrainingPlan(epochs=1, patience=1, sequence_length=200, burn_in=20, batch_size=4)
FOREST = ForestPlan(trees=4, depth=4, rows=2000, leaf=5)
SMALL, DEEP = Architecture(1, 8, 0.0, 3e-3), Architecture(2, 8, 0.1, 3e-3)
ROWS = 800
LOAD = PositionLoad(0.05, 0.2, np.array([-5.0, 8.0, 3.0]), np.full(3, 1.0))


def _with_load_by_position(name: str, cylinder: Cylinder) -> FrictionEstimator:
    return baselines(cylinder, forest_plan=FOREST, position_load=LOAD)[name]


def _adapted(cylinder: Cylinder) -> FrictionEstimator:
    """Return a hybrid that is fitted by adapting another one, which learned from the first recording alone."""
    made = HybridEstimator(cylinder, "force_balance", SMALL, PLAN, FOREST)

    def fit(recordings: Sequence[Recording]) -> FrictionEstimator:
        first = [each.without_columns("load_force_n") for each in recordings[:1]]
        source = HybridEstimator(cylinder, "force_balance", SMALL, PLAN, FOREST).fit(first)
        vars(made).update(vars(source.adapt(recordings, cylinder, plan=replace(PLAN, patience=None))))
        return made

    made.fit = fit  # type: ignore[method-assign, assignment]
    return made


MAKERS: dict[str, Callable[[Cylinder], FrictionEstimator]] = {
    "force_balance_unfiltered": lambda cylinder: ForceBalanceEstimator(cylinder, "none"),
    "force_balance_paper": lambda cylinder: ForceBalanceEstimator(cylinder, "paper"),
    "force_balance_low_pass": LowPassForceBalanceEstimator,
    "ridge": lambda cylinder: RidgeEstimator(lags=8),
    "random_forest": lambda cylinder: ForestEstimator(cylinder, FOREST),
    "lugre": lambda cylinder: LugreEstimator(cylinder, condition="1", population=4, generations=2),
    "pressure_lugre": lambda cylinder: PressureLugreEstimator(cylinder, condition="1", population=4, generations=2),
    "analytical": lambda cylinder: AnalyticalEstimator(cylinder, model_named("lugre"), effort=scaled_effort(0.01)),
    "hybrid": lambda cylinder: HybridEstimator(cylinder, "force_balance", SMALL, PLAN, FOREST),
    "lstm": lambda cylinder: HybridEstimator(cylinder, "force_balance", DEEP, PLAN, None),
    "adapted_hybrid": _adapted,
    "hybrid_of_position": lambda cylinder: HybridEstimator(
        cylinder, architecture=SMALL, plan=PLAN, forest_plan=FOREST, inputs=("position_m",)
    ),
    "hybrid_with_measured_load": lambda cylinder: HybridEstimator(
        cylinder, "force_balance", SMALL, PLAN, FOREST, inputs=(*SAMPLE_COLUMNS, "load_force_n")
    ),
    "hybrid_with_load_by_position": lambda cylinder: HybridEstimator(
        cylinder, "force_balance", SMALL, PLAN, FOREST, position_load=LOAD
    ),
    **{
        f"{name}_with_load_by_position": partial(_with_load_by_position, name)
        for name in ("force_balance_paper", "force_balance_low_pass", "ridge", "random_forest")
    },
    "paper_hybrid": lambda cylinder: HybridEstimator(cylinder, "paper", SMALL, PLAN, FOREST),
}


TAKE_A_LOAD = ("adapted_hybrid", "hybrid_with_measured_load")


@pytest.fixture(scope="module")
def recordings(labelled_recordings: list[Recording]) -> list[Recording]:
    """The first seconds of each, with an oil temperature, and pressures that vary slowly."""
    made = []
    for number, whole in enumerate(labelled_recordings):
        recording = Recording(whole.metadata, whole.table.iloc[:ROWS].reset_index(drop=True))
        levels = {
            f"pressure_{side}_level_pa": np.full(ROWS, recording.column(f"pressure_{side}_pa").mean())
            for side in (1, 2)
        }
        temperature_c = np.linspace(30.0, 35.0, ROWS) + number
        made.append(recording.with_columns(oil_temperature_c=temperature_c, **levels))
    return made


@pytest.fixture(scope="module", params=sorted(MAKERS))
def case(request: pytest.FixtureRequest, cylinder: Cylinder, recordings: list[Recording]) -> Case:
    small_n = {"load_force_n": np.linspace(0.0, 9.0, ROWS)} if request.param in TAKE_A_LOAD else {}
    return Case(partial(MAKERS[request.param], cylinder), [each.with_columns(**small_n) for each in recordings])


def test_it_keeps_every_promise_and_friction_is_of_the_right_size(case: Case) -> None:
    for check in CHECKS:
        check(case)
    error_n = np.abs(case.estimate - case.recording.column("friction_n")).mean()
    assert error_n < 1.1 * np.abs(case.recording.column("friction_n")).mean()


def test_no_estimator_is_forgotten(cylinder: Cylinder) -> None:
    made = {type(make(cylinder)) for make in MAKERS.values()}
    assert set(KINDS) - made == set()


class Forgetful(ForceBalanceEstimator):
    """Breaks the contract in one way: the memory lies in the estimator, not in the state."""

    kind = "forgetful"
    last_n = 0.0

    def advance(self, state: object, samples: np.ndarray) -> np.ndarray:
        friction_n = super().advance(state, samples)
        estimate_n, self.last_n = friction_n + 1e-3 * self.last_n, float(friction_n[-1])
        return estimate_n


def test_a_broken_promise_is_named(cylinder: Cylinder, recordings: list[Recording]) -> None:
    with pytest.raises(ContractError, match=r"forgetful: .*: row \d+ is -?[\d.]+ N, but expected -?[\d.]+ N"):
        check_estimator(lambda: Forgetful(cylinder, "none"), recordings)
