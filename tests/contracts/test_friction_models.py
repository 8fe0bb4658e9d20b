"""LuGre keeps the contract of friction models, and each way of breaking it is noticed."""

from collections.abc import Callable

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.testing.estimator_contract import ContractError
from cylinder_friction.testing.friction_model_contract import CHECKS, FrictionModelCase, check_friction_model
from friction_samples import ODD

CASE = FrictionModelCase(LuGre, ODD["lugre"])


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_lugre_keeps_the_contract(check: Callable[[FrictionModelCase], None]) -> None:
    check(CASE)


class Broken(LuGre):
    """LuGre whose output is changed by ``change``."""

    def simulate(
        self, values: Array, velocity_m_s: Array, sample_time_s: float, state: Array, pressure_pa: Array | None = None
    ) -> Array:
        friction_n = super().simulate(values, velocity_m_s, sample_time_s, state, pressure_pa)
        return self.change(friction_n, np.asarray(velocity_m_s), state, pressure_pa)

    def change(self, friction_n: Array, velocity_m_s: Array, state: Array, pressure_pa: Array | None) -> Array:
        raise NotImplementedError


class Lopsided(Broken):
    def change(self, friction_n: Array, velocity_m_s: Array, state: Array, pressure_pa: Array | None) -> Array:
        return friction_n + 1.0


class Forgetful(Broken):
    def change(self, friction_n: Array, velocity_m_s: Array, state: Array, pressure_pa: Array | None) -> Array:
        state[:] = 0.0
        return friction_n


class Driving(Broken):
    def change(self, friction_n: Array, velocity_m_s: Array, state: Array, pressure_pa: Array | None) -> Array:
        return -friction_n


class Strong(Broken):
    def change(self, friction_n: Array, velocity_m_s: Array, state: Array, pressure_pa: Array | None) -> Array:
        return 1.5 * friction_n


class Relaxing(Broken):
    def change(self, friction_n: Array, velocity_m_s: Array, state: Array, pressure_pa: Array | None) -> Array:
        return np.where(velocity_m_s == 0.0, 0.99 ** np.arange(len(friction_n)) * friction_n, friction_n)


class Relieved(Broken):
    def change(self, friction_n: Array, velocity_m_s: Array, state: Array, pressure_pa: Array | None) -> Array:
        assert pressure_pa is not None
        return friction_n * np.where(pressure_pa < 0.0, 0.9, 1.0)


@pytest.mark.parametrize(
    ("kind", "check", "message"),
    [
        (Lopsided, "without_direction_friction_is_odd", "lugre: friction of the opposite motion is not the opposite"),
        (Forgetful, "cutting_the_samples_changes_no_bit", "lugre: friction differs when samples are cut at"),
        (Driving, "a_closed_loop_of_travel_takes_energy", "J, but friction can only take energy"),
        (Driving, "steady_sliding_ends_on_the_curve", r"steady friction is -\S+ N at 0.02 m/s and 0 Pa, but expected"),
        (Strong, "dry_friction_never_exceeds_breakaway", r"dry friction reaches 6\d\d\S* N, above 432 N of breakaway"),
        (Relaxing, "at_standstill_friction_stays", r"friction changes by \S+ N at rest"),
        (Relieved, "below_zero_gauge_pressure_relieves_the_seal_no_further", "at a pressure below zero is not that"),
    ],
)
def test_a_broken_promise_is_noticed(kind: type[Broken], check: str, message: str) -> None:
    case = FrictionModelCase(kind, ODD["lugre"])
    (chosen,) = (each for each in CHECKS if each.__name__ == check)
    with pytest.raises(ContractError, match=message):
        chosen(case)
    with pytest.raises(ContractError):
        check_friction_model(kind, ODD["lugre"])
