"""The contract of every friction model in the catalogue, and what holds for one model alone."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.friction_models.catalogue import MODELS, model_named
from cylinder_friction.friction_models.film_lugre import FilmLugreParameters
from cylinder_friction.friction_models.maxwell_slip import MaxwellSlipParameters
from cylinder_friction.friction_models.stribeck import StribeckCurve
from friction_samples import ODD

if TYPE_CHECKING:
    from cylinder_friction.friction_models.parameters import ModelParameters

STEP_S = 5e-3
NAMES = sorted(ODD)
SIDED = {name: replace(each, retract_ratio=1.2, pressure_slope_n_pa=4e-5) for name, each in ODD.items()}
names = st.sampled_from(NAMES)
paths = st.lists(st.one_of(st.just(0.0), st.floats(-0.3, 0.3)), min_size=1, max_size=60)


def friction(
    parameters: ModelParameters, name: str, path: list[float] | np.ndarray, step_s: float = STEP_S
) -> np.ndarray:
    model = model_named(name)
    return model.simulate(parameters.packed(), np.asarray(path), step_s, model.new_state())


@pytest.mark.parametrize("name", NAMES)
def test_numbers_stand_in_the_order_of_their_specs(name: str) -> None:
    """Compiled loops, files and ``packed`` count on it; the curve's come first, what scales dry friction last."""
    specs = [spec.name for spec in model_named(name).specs]
    assert [field.name for field in fields(ODD[name])] == specs
    assert specs[-2:] == ["retract_ratio", "pressure_slope_n_pa"]
    if name != "dahl":
        assert specs[:5] == [field.name for field in fields(StribeckCurve)][:5]


def test_every_model_of_the_catalogue_is_under_contract() -> None:
    assert set(MODELS) == {*NAMES, *(f"pressure_{name}" for name in NAMES)}


@pytest.mark.parametrize("name", NAMES)
def test_below_zero_gauge_pressure_relieves_the_seal_no_further(name: str) -> None:
    """A noisy sensor on an open port reads below zero; dry friction is then that of zero pressure, never less."""
    model, values = model_named(f"pressure_{name}"), replace(SIDED[name], pressure_slope_n_pa=1e-3).packed()
    path = np.concatenate([np.full(50, 0.02), np.zeros(10), np.full(50, -0.02), np.full(20, 1e-4)])

    def at(pressure_pa: float) -> np.ndarray:
        return model.simulate(values, path, STEP_S, model.new_state(), np.full(len(path), pressure_pa))

    np.testing.assert_array_equal(at(-2e5), at(0.0))
    assert np.abs(at(2e5) - at(0.0)).max() > 100.0


@settings(deadline=None)
@given(names, paths)
def test_without_direction_friction_is_odd(name: str, path: list[float]) -> None:
    there, back = friction(ODD[name], name, path), friction(ODD[name], name, -np.array(path))
    np.testing.assert_array_equal(there, -back)


@settings(deadline=None)
@given(names, paths)
def test_dry_friction_never_exceeds_breakaway(name: str, path: list[float]) -> None:
    rate_free = {"viscous_n_s_m": 0.0} | ({"bristle_damping_n_s_m": 0.0} if "lugre" in name else {})
    parameters = replace(SIDED[name], **rate_free)
    breakaway = 1.2 * (240.0 if name == "dahl" else 360.0)
    assert np.abs(friction(parameters, name, path)).max() <= breakaway * (1.0 + 1e-9)


@settings(deadline=None)
@given(names, st.floats(2e-2, 0.5), st.sampled_from([-1.0, 1.0]), st.floats(0.0, 1e7))
def test_steady_sliding_ends_on_the_curve(name: str, speed: float, direction: float, pressure_pa: float) -> None:
    velocity, parameters = direction * speed, SIDED[name]
    static = 240.0 if name == "dahl" else 360.0
    if isinstance(parameters, FilmLugreParameters):
        static *= 1.0 - (1.0 - 240.0 / 360.0) * min(speed / parameters.film_velocity_m_s, 1.0) ** (2.0 / 3.0)
    curve = StribeckCurve(240.0, static, 8e-3, 1.5, 0.0, 1.2)
    expected = float(curve.friction(np.array(velocity))) * (1.0 + 4e-5 * pressure_pa / 240.0) + 1500.0 * velocity
    model = model_named(f"pressure_{name}")
    held, pressure = np.full(4000, velocity), np.full(4000, pressure_pa)
    found = model.simulate(parameters.packed(), held, STEP_S, model.new_state(), pressure)[-1]
    assert found == pytest.approx(expected, rel=1e-6)


@settings(deadline=None)
@given(names, st.integers(0, 2**31), st.integers(1, 199))
def test_cutting_the_samples_changes_no_bit(name: str, seed: int, cut: int) -> None:
    generator = np.random.default_rng(seed)
    velocity = generator.normal(0.0, 0.02, 200) * (generator.random(200) > 0.3)
    pressure = generator.uniform(-1e5, 6e6, 200)
    model, values = model_named(f"pressure_{name}"), SIDED[name].packed()
    whole = model.simulate(values, velocity, STEP_S, model.new_state(), pressure)
    state = model.new_state()
    pieces = [
        model.simulate(values, velocity[part], STEP_S, state, pressure[part]) for part in (slice(cut), slice(cut, None))
    ]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


@settings(deadline=None)
@given(names, st.floats(1e-6, 0.05), st.floats(0.2, 5.0))
def test_a_closed_loop_of_travel_takes_energy_and_gives_none(name: str, amplitude_m: float, cycle_s: float) -> None:
    step_s = cycle_s / 2000
    time_s = step_s * (np.arange(4 * 2000) + 0.5)
    velocity = amplitude_m * 2.0 * np.pi / cycle_s * np.cos(2.0 * np.pi * time_s / cycle_s)
    force = friction(replace(SIDED[name], viscous_n_s_m=0.0), name, velocity, step_s)
    last = slice(3 * 2000, None)
    work = float(np.sum(force[last] * velocity[last]) * step_s)
    assert work >= -1e-6 * 360.0 * amplitude_m


@pytest.mark.parametrize("name", [name for name in NAMES if name != "stribeck"])
def test_at_standstill_friction_is_kept(name: str) -> None:
    moved = friction(replace(ODD[name], viscous_n_s_m=0.0), name, [0.0, 0.02, 0.02, 0.0, 0.0, 0.0])
    assert moved[0] == 0.0
    assert moved[3] == moved[4] == moved[5] > 200.0


def test_the_static_curve_keeps_its_share_of_static_friction_at_standstill() -> None:
    moved = friction(SIDED["stribeck"], "stribeck", [0.0, 0.02, 0.0, 0.0, -1e-3, 0.0])
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


@pytest.mark.parametrize("name", sorted(MODELS))
def test_specs_name_every_number_and_the_first_guess_lies_within(name: str) -> None:
    model = MODELS[name]
    assert model.name == name
    curve = StribeckCurve(240.0, 360.0, 8e-3, 1.5, 1500.0, 1.2)
    guess = model.first_guess(curve, 5e6, 2e6 if model.pressure_scaled else 0.0)
    assert [spec.name for spec in model.specs] == list(vars(guess))
    assert model.parameters(guess.packed()) == guess
    assert all(spec.unit and spec.meaning for spec in model.specs)
    slope = guess.value("pressure_slope_n_pa")
    assert (slope > 0.0) == model.pressure_scaled
    assert guess.value("coulomb_n") + slope * 2e6 == pytest.approx(240.0)
    for spec in model.searched:
        if spec.relative_to == "":
            assert spec.lower <= guess.value(spec.name) <= spec.upper, spec.name


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


def test_an_unknown_model_is_refused_with_the_known() -> None:
    with pytest.raises(ValueError, match=r"friction model is 'bouc_wen', but expected one of \['dahl', 'film_lugre'"):
        model_named("bouc_wen")
