from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from cylinder_friction.friction_models.lugre import LugreParameters
from friction_samples import PLAIN_LUGRE as PLAIN
from friction_samples import new_bristle, simulate

DIRECTED = replace(PLAIN, retract_ratio=1.2, pressure_slope_n_pa=4e-5)
velocities = st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=60)


def deflection_rate(parameters: LugreParameters, velocity: float, bristle: float) -> float:
    dry = float(parameters.curve.dry_friction(np.array(velocity)))
    return velocity - parameters.bristle_stiffness_n_m * abs(velocity) / dry * bristle


def test_a_moving_velocity_is_followed_like_a_stiff_solver_does() -> None:
    step = 1e-5
    time_s = step * np.arange(1, 40_001)

    def velocity(at: float | np.ndarray) -> np.ndarray:
        return np.asarray(0.02 * np.sin(2.0 * np.pi * 5.0 * at))

    reference = solve_ivp(
        lambda at, state: [deflection_rate(PLAIN, float(velocity(at)), state[0])],
        (0.0, float(time_s[-1])),
        [0.0],
        method="Radau",
        t_eval=time_s[99::100],
        rtol=1e-8,
        atol=1e-13,
        max_step=1e-3,
    )
    v = velocity(reference.t)
    bristle = reference.y[0]
    rate = np.array([deflection_rate(PLAIN, *pair) for pair in zip(v, bristle, strict=True)])
    damping = PLAIN.bristle_damping_n_s_m * np.exp(-((v / PLAIN.damping_velocity_m_s) ** 2))
    friction = PLAIN.bristle_stiffness_n_m * bristle + damping * rate + PLAIN.viscous_n_s_m * v
    # The velocity halfway is the one that is held over a step.
    stepped = simulate(PLAIN, velocity(time_s - 0.5 * step), step, new_bristle())[99::100]
    assert np.abs(stepped - friction).mean() < 0.2
    assert np.abs(stepped - friction).max() < 2.0


@settings(deadline=None)
@given(velocities)
def test_the_bristle_never_bends_further_than_static_friction_does(path: list[float]) -> None:
    bristle = new_bristle()
    limit = DIRECTED.static_n * DIRECTED.retract_ratio / DIRECTED.bristle_stiffness_n_m
    for velocity in path:
        simulate(DIRECTED, np.array([velocity]), 5e-3, bristle)
        assert abs(bristle[0]) <= limit * (1.0 + 1e-12)


@settings(deadline=None)
@given(velocities)
def test_without_direction_the_model_is_odd(path: list[float]) -> None:
    there = simulate(PLAIN, np.array(path), 5e-3, new_bristle())
    back = simulate(PLAIN, -np.array(path), 5e-3, new_bristle())
    np.testing.assert_array_equal(there, -back)


@settings(deadline=None)
@given(st.floats(1e-3, 0.5), st.sampled_from([-1.0, 1.0]), st.floats(0.0, 1e7))
def test_steady_sliding_ends_on_the_stribeck_curve_scaled_by_pressure(
    speed: float, direction: float, pressure_pa: float
) -> None:
    velocity = direction * speed
    friction = simulate(DIRECTED, np.full(4000, velocity), 5e-3, new_bristle(), np.full(4000, pressure_pa))[-1]
    scale = 1.0 + DIRECTED.pressure_slope_n_pa * pressure_pa / DIRECTED.coulomb_n
    dry = float(DIRECTED.curve.dry_friction(np.array(velocity))) * scale
    assert friction == pytest.approx(direction * dry + DIRECTED.viscous_n_s_m * velocity, rel=1e-6)
    assert friction * velocity > 0.0


@settings(deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 199))
def test_cutting_the_samples_changes_no_bit(seed: int, cut: int) -> None:
    generator = np.random.default_rng(seed)
    velocity = generator.normal(0.0, 0.02, 200) * (generator.random(200) > 0.3)
    pressure = generator.uniform(-1e5, 6e6, 200)
    whole = simulate(DIRECTED, velocity, 5e-3, new_bristle(), pressure)
    bristle = new_bristle()
    pieces = [
        simulate(DIRECTED, velocity[part], 5e-3, bristle, pressure[part]) for part in (slice(cut), slice(cut, None))
    ]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_at_standstill_friction_stays_what_it_was() -> None:
    friction = simulate(PLAIN, np.array([0.0, 0.02, 0.02, 0.0, 0.0]), 5e-3, new_bristle())
    assert friction[0] == 0.0
    assert friction[3] == friction[4] > 0.0


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31))
def test_a_passive_model_gives_back_no_more_than_its_bristles_hold(seed: int) -> None:
    generator = np.random.default_rng(seed)
    step = 1e-5
    velocity = np.repeat(generator.normal(0.0, 0.02, 20), 500)
    bristle = new_bristle()
    friction = simulate(PLAIN, velocity, step, bristle)
    assert PLAIN.is_passive()
    stored = 0.5 * PLAIN.bristle_stiffness_n_m * bristle[0] ** 2
    put_in = float(np.sum(friction * velocity) * step)
    assert put_in >= stored * (1.0 - 1e-3) - 1e-6


def test_passivity_is_lost_when_damping_reaches_too_far() -> None:
    limit = PLAIN.passive_damping_velocity_m_s
    assert limit == pytest.approx(4.0 * np.sqrt(2.0 * np.e) * 240.0 / 4000.0)
    assert not replace(PLAIN, damping_velocity_m_s=1.01 * limit).is_passive()
    assert replace(PLAIN, bristle_damping_n_s_m=0.0, damping_velocity_m_s=1e3).is_passive()


def test_impossible_parameters_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"bristle_stiffness_n_m must be a positive number, but got 0\.0"):
        replace(PLAIN, bristle_stiffness_n_m=0.0)
    with pytest.raises(ValueError, match=r"pressure_slope_n_pa must be zero or a positive number, but got -1\.0"):
        replace(PLAIN, pressure_slope_n_pa=-1.0)


def test_pressure_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"pressure_pa has shape \(2,\), but velocity_m_s has \(3,\)"):
        simulate(PLAIN, np.zeros(3), 5e-3, new_bristle(), np.zeros(2))
