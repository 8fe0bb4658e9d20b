"""What holds for one friction model alone; the contract of all is in ``test_contract``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from friction_benchmark.friction_models import FRICTION_MODELS
from friction_benchmark.friction_models.maxwell_slip import MaxwellSlipParameters
from model_samples import ODD

if TYPE_CHECKING:
    from cylinder_friction.friction_models.parameters import ModelParameters

STEP_S = 5e-3


def friction(parameters: ModelParameters, name: str, path: list[float] | np.ndarray) -> np.ndarray:
    model = FRICTION_MODELS[name]
    return model.simulate(parameters.packed(), np.asarray(path), STEP_S, model.new_state())


@pytest.mark.parametrize("name", [name for name in ODD if name != "stribeck"])
def test_at_standstill_friction_is_kept(name: str) -> None:
    moved = friction(replace(ODD[name], viscous_n_s_m=0.0), name, [0.0, 0.02, 0.02, 0.0, 0.0, 0.0])
    assert moved[0] == 0.0
    assert moved[3] == moved[4] == moved[5] > 200.0


def test_the_static_curve_keeps_its_share_of_static_friction_at_standstill() -> None:
    moved = friction(replace(ODD["stribeck"], retract_ratio=1.2), "stribeck", [0.0, 0.02, 0.0, 0.0, -1e-3, 0.0])
    assert moved[0] == 0.0
    np.testing.assert_allclose(moved[[2, 3, 5]], [0.6 * 360.0, 0.6 * 360.0, -1.2 * 0.6 * 360.0])


def to_and_fro(travels_m: list[float], rows: int = 50, step_s: float = STEP_S) -> np.ndarray:
    return np.concatenate([np.full(rows, travel / (rows * step_s)) for travel in travels_m])


def test_maxwell_slip_closes_inner_loops_and_does_not_drift_where_lugre_does() -> None:
    """Presliding goes back through the point where an inner loop began: the memory that LuGre lacks."""
    loops = to_and_fro([2e-5] + [-8e-6, 8e-6] * 40)
    after_each_loop = slice(49, None, 100)
    drift = {}
    for name in ("gms", "lugre"):
        force = friction(replace(ODD[name], viscous_n_s_m=0.0), name, loops)[after_each_loop]
        drift[name] = float(np.ptp(force))
    assert drift["gms"] < 1e-6
    assert drift["lugre"] > 5.0


@settings(deadline=None)
@given(st.floats(1.05, 500.0), st.floats(0.05, 20.0))
def test_maxwell_slip_elements_share_all_of_friction_and_stiffness(spread: float, tilt: float) -> None:
    parameters = ODD["gms"]
    assert isinstance(parameters, MaxwellSlipParameters)
    stiffnesses, shares = replace(parameters, travel_spread=spread, share_tilt=tilt).elements()
    travels = shares / stiffnesses
    assert shares.sum() == pytest.approx(1.0)
    assert stiffnesses.sum() == pytest.approx(5e6)
    assert travels[-1] / travels[0] == pytest.approx(spread)
    assert shares[-1] / shares[0] == pytest.approx(tilt)
    assert np.all(np.diff(travels) > 0.0)


def test_breakaway_grows_with_dwell_on_a_film_that_thins() -> None:
    """The film that sliding built is still there after a short rest, and gone after a long one."""

    def breakaway(rest_s: float) -> float:
        slid = [0.05] * 200 + [0.0] * round(rest_s / STEP_S)
        force = friction(replace(ODD["film_lugre"], film_inertia_s=1e-9), "film_lugre", [*slid, *([2e-3] * 10)])
        return float(force[-10:].max())

    rests = [breakaway(rest_s) for rest_s in (0.05, 1.0, 4.0, 20.0)]
    assert rests == sorted(rests)
    assert rests[-1] > 1.2 * rests[0]


def test_fluid_inertia_leads_on_acceleration() -> None:
    rising = np.linspace(0.05, 0.1, 11)
    with_it, without = (
        friction(replace(ODD["film_lugre"], film_inertia_s=lead), "film_lugre", rising) for lead in (0.02, 1e-12)
    )
    assert with_it[0] == pytest.approx(without[0])
    np.testing.assert_allclose(with_it[1:] - without[1:], 1500.0 * 0.02 * 0.005 / STEP_S, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "field", "value", "expected"),
    [
        ("dahl", "bristle_stiffness_n_m", 0.0, "DahlParameters: bristle_stiffness_n_m must be a positive number"),
        ("gms", "travel_spread", float("nan"), "MaxwellSlipParameters: travel_spread must be a positive number"),
        ("film_lugre", "static_n", 200.0, r"static_n must be at least coulomb_n \(240.0 N\), but got 200.0 N"),
        ("stribeck", "viscous_n_s_m", -1.0, "viscous_n_s_m must be zero or a positive number, but got -1.0"),
    ],
)
def test_impossible_numbers_are_refused_by_name(name: str, field: str, value: float, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        replace(ODD[name], **{field: value})
