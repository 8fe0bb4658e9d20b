"""The simulator of LuGre against SciPy's stiff solvers, on a held velocity with reversals, dwell and presliding.

The equation is written here once more, in its textbook form, and solved sample by sample to tight tolerances.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.catalogue import model_named
from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
from friction_samples import PLAIN_LUGRE, held_path

STEP_S = 5e-3
PRESSURE_PA = 3e6
SIDED = {"retract_ratio": 1.2, "pressure_slope_n_pa": 4e-5}


def solved(rate: Callable[[float, Array], Array], state: Array, length_s: float) -> Array:
    found = solve_ivp(rate, (0.0, length_s), state, method="Radau", rtol=1e-10, atol=1e-10)
    assert found.success
    return np.asarray(found.y[:, -1])


def strength(p: LugreParameters, velocity: float) -> float:
    """Return Stribeck strength [N] with direction and pressure."""
    falling = np.exp(-((abs(velocity) / p.stribeck_velocity_m_s) ** p.stribeck_exponent))
    dry = p.coulomb_n + (p.static_n - p.coulomb_n) * falling
    side = p.retract_ratio if velocity < 0.0 else 1.0
    return float(dry * side * (1.0 + p.pressure_slope_n_pa * PRESSURE_PA / p.coulomb_n))


def lugre_reference(p: LugreParameters, path: Array) -> Array:
    """Return friction [N]; the rate behind the damping is the mean over a sample."""
    bristle_n, friction = np.zeros(1), []
    for velocity in path:

        def rate(_: float, force: Array, v: float = velocity) -> Array:
            return p.bristle_stiffness_n_m * (v - abs(v) / strength(p, v) * force)

        after = solved(rate, bristle_n, STEP_S)
        deflection_rate = (after[0] - bristle_n[0]) / p.bristle_stiffness_n_m / STEP_S
        damping = p.bristle_damping_n_s_m * np.exp(-((velocity / p.damping_velocity_m_s) ** 2))
        friction.append(after[0] + damping * deflection_rate + p.viscous_n_s_m * velocity)
        bristle_n = after
    return np.array(friction)


def test_lugre_agrees_with_a_stiff_solver() -> None:
    parameters, path = replace(PLAIN_LUGRE, **SIDED), held_path(STEP_S)
    model = LuGre(pressure_scaled=True)
    pressure_pa = np.full(len(path), PRESSURE_PA)
    friction_n = model.simulate(parameters.packed(), path, STEP_S, model.new_state(), pressure_pa)
    assert np.abs(friction_n - lugre_reference(parameters, path)).max() < 1e-6


def test_an_unknown_model_is_refused_with_the_known() -> None:
    with pytest.raises(ValueError, match=r"friction model is 'bouc_wen', but expected one of \['lugre', 'pressure_"):
        model_named("bouc_wen")
