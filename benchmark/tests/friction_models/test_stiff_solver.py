"""Every simulator against SciPy's stiff solvers, on a held velocity with reversals, dwell and presliding.

The equations are written here once more, in their textbook form, and solved sample by sample to tight tolerances.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from friction_benchmark.friction_models import FRICTION_MODELS
from friction_benchmark.friction_models.film_lugre import FilmLugreParameters
from model_samples import ODD, held_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from cylinder_friction.arrays import Array
    from cylinder_friction.friction_models.lugre import LugreParameters
    from cylinder_friction.friction_models.parameters import ModelParameters
    from friction_benchmark.friction_models.coulomb_stribeck import CoulombStribeckParameters
    from friction_benchmark.friction_models.dahl import DahlParameters
    from friction_benchmark.friction_models.maxwell_slip import MaxwellSlipParameters


STEP_S = 5e-3
PRESSURE_PA = 3e6
SIDED = {"retract_ratio": 1.2, "pressure_slope_n_pa": 4e-5}


def solved(rate: Callable[[float, Array], Array], state: Array, length_s: float) -> Array:
    found = solve_ivp(rate, (0.0, length_s), state, method="Radau", rtol=1e-10, atol=1e-10)
    assert found.success
    return np.asarray(found.y[:, -1])


def strength(p: ModelParameters, velocity: float, film: float = 0.0) -> float:
    """Return Stribeck strength [N] with direction and pressure."""
    coulomb = p.value("coulomb_n")
    if hasattr(p, "static_n"):
        falling = np.exp(-((abs(velocity) / p.value("stribeck_velocity_m_s")) ** p.value("stribeck_exponent")))
        dry = coulomb + ((1.0 - film) * p.value("static_n") - coulomb) * falling
    else:
        dry = coulomb
    side = p.value("retract_ratio") if velocity < 0.0 else 1.0
    return float(dry * side * (1.0 + p.value("pressure_slope_n_pa") * PRESSURE_PA / coulomb))


def stribeck_reference(p: CoulombStribeckParameters, path: Array) -> Array:
    friction, direction, side_speed = [], 0.0, 1.0
    for velocity in path:
        if velocity != 0.0:
            direction = float(np.sign(velocity))
            side_speed = direction
        risen = p.standstill_share + (1.0 - p.standstill_share) * np.tanh(abs(velocity) / p.regularising_velocity_m_s)
        dry = strength(p, velocity if velocity != 0.0 else 1e-30 * side_speed)
        friction.append(direction * dry * risen + p.viscous_n_s_m * velocity)
    return np.array(friction)


def dahl_reference(p: DahlParameters, path: Array) -> Array:
    state, friction = np.zeros(1), []
    for velocity in path:

        def rate(_: float, dry: Array, v: float = velocity) -> Array:
            return p.bristle_stiffness_n_m * v * (1.0 - dry / strength(p, v) * np.sign(v))

        state = solved(rate, state, STEP_S)
        friction.append(state[0] + p.viscous_n_s_m * velocity)
    return np.array(friction)


def lugre_reference(p: LugreParameters | FilmLugreParameters, path: Array) -> Array:
    """Bristle force and, where there is one, film; the damping's rate is the mean over a sample."""
    film = p if isinstance(p, FilmLugreParameters) else None
    state, friction, last = np.zeros(2), [], path[0]
    for velocity in path:

        def rate(_: float, both: Array, v: float = velocity) -> Array:
            bristle_n, thickness = both
            strain = p.bristle_stiffness_n_m * (v - abs(v) / strength(p, v, thickness) * bristle_n)
            return np.array([strain, 0.0 if film is None else film_rate(film, thickness, v)])

        after = solved(rate, state, STEP_S)
        deflection_rate = (after[0] - state[0]) / p.bristle_stiffness_n_m / STEP_S
        damping = p.bristle_damping_n_s_m * np.exp(-((velocity / p.damping_velocity_m_s) ** 2))
        lead = 0.0 if film is None else film.film_inertia_s * (velocity - last) / STEP_S
        friction.append(after[0] + damping * deflection_rate + p.viscous_n_s_m * (velocity + lead))
        state, last = after, velocity
    return np.array(friction)


def film_rate(p: FilmLugreParameters, thickness: float, velocity: float) -> float:
    at_most = 1.0 - p.coulomb_n / p.static_n
    factor = at_most * p.film_velocity_m_s ** (-2.0 / 3.0)
    steady = factor * min(abs(velocity), p.film_velocity_m_s) ** (2.0 / 3.0)
    if velocity == 0.0:
        return (steady - thickness) / p.film_dwell_s
    return (steady - thickness) / (p.film_build_s if thickness <= steady else p.film_squeeze_s)


def gms_reference(p: MaxwellSlipParameters, path: Array) -> Array:
    stiffnesses, shares = p.elements()
    force, slips = np.zeros(len(shares)), np.zeros(len(shares), dtype=bool)
    last, friction = 0.0, []
    for velocity in path:
        if velocity == 0.0 or velocity * last < 0.0:
            slips[:] = False
        if velocity != 0.0:
            s = strength(p, velocity)
            for i, (stiffness, share) in enumerate(zip(stiffnesses, shares, strict=True)):
                force[i], slips[i] = element(force[i], slips[i], velocity, stiffness, share, s, p.attraction_n_s)
        last = velocity
        friction.append(force.sum() + p.viscous_n_s_m * velocity)
    return np.array(friction)


def element(
    force: float, slips: bool, velocity: float, stiffness: float, share: float, s: float, attraction: float
) -> tuple[float, bool]:
    way, left = np.sign(velocity), STEP_S
    if not slips and way * force < share * s:

        def reaches_its_limit(_: float, f: Array) -> float:
            return float(way * f[0] - share * s)

        reaches_its_limit.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(
            lambda _, f: [stiffness * velocity], (0.0, left), [force], events=reaches_its_limit, rtol=1e-10, atol=1e-10
        )
        force, left = float(found.y[0, -1]), left - float(found.t[-1])
        if found.status != 1:
            return force, False
    if left > 0.0:
        force = float(solved(lambda _, f: attraction * (share * way - f / s), np.array([force]), left)[0])
    return force, True


REFERENCES: dict[str, Callable[..., Array]] = {
    "stribeck": stribeck_reference,
    "dahl": dahl_reference,
    "lugre": lugre_reference,
    "film_lugre": lugre_reference,
    "gms": gms_reference,
}
TOLERANCES_N = {"stribeck": 1e-9, "dahl": 1e-6, "lugre": 1e-6, "film_lugre": 0.5, "gms": 1e-6}
"""All steps are exact but that of the bristles on a film, which moves within a step."""


def stepped(name: str, parameters: ModelParameters, path: Array, step_s: float = STEP_S) -> Array:
    model = FRICTION_MODELS[f"pressure_{name}"]
    pressure = np.full(len(path), PRESSURE_PA)
    return model.simulate(parameters.packed(), path, step_s, model.new_state(), pressure)


@pytest.mark.parametrize("name", sorted(REFERENCES))
def test_a_simulator_agrees_with_a_stiff_solver(name: str) -> None:
    parameters, path = replace(ODD[name], **SIDED), held_path(STEP_S)
    difference = stepped(name, parameters, path) - REFERENCES[name](parameters, path)
    assert np.abs(difference).max() < TOLERANCES_N[name]


def test_the_film_moving_within_a_step_costs_an_error_that_falls_with_the_square_of_the_step() -> None:
    parameters = replace(ODD["film_lugre"], film_inertia_s=1e-9, bristle_damping_n_s_m=0.0)
    coarse = held_path(STEP_S)
    finest = stepped("film_lugre", parameters, np.repeat(coarse, 64), STEP_S / 64)[63::64]
    errors = [
        np.abs(
            stepped("film_lugre", parameters, np.repeat(coarse, finer), STEP_S / finer)[finer - 1 :: finer] - finest
        ).max()
        for finer in (1, 2, 4)
    ]
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]
