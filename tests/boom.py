"""Strokes of a cylinder that carries a boom, with load and friction known in closed form."""

from collections.abc import Callable

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.labelling.strokes import StrokePoints, stroke_points

STEP_S = 0.01


def boom_load(position_m: Array) -> Array:
    """Gravity on a boom that the cylinder lifts at a changing lever arm [N]."""
    angle = 0.2 + 4.0 * (position_m - 0.05)
    return np.asarray(6000.0 * np.cos(angle) / np.sqrt(1.0 - 0.5 * np.sin(angle) ** 2))


def load_at_angle(position_m: Array, other_m: Array) -> Array:
    """Return the same where another cylinder has raised what the boom is mounted on [N]."""
    return np.asarray(boom_load(position_m) * np.cos(3.0 * (np.asarray(other_m) - 0.5)))


def motion(seconds: float = 120.0, reach_m: float = 0.08) -> tuple[Array, Array, Array]:
    """Return position, velocity and acceleration of slow strokes whose speed changes, each of shape ``(n,)``."""
    time_s = STEP_S * np.arange(round(seconds / STEP_S))
    position_m = 0.125 + reach_m * np.sin(0.4 * time_s) * np.cos(0.03 * time_s)
    velocity = np.gradient(position_m, STEP_S)
    return position_m, velocity, np.gradient(velocity, STEP_S)


def boom_points(
    seed: int = 0,
    coulomb_n: float = 400.0,
    viscous_n_s_m: float = 2000.0,
    asymmetry_n: float = 0.0,
    seconds: float = 120.0,
    plan: LoadPlan | None = None,
    other_m: Callable[[Array, Array], Array] | None = None,
    pressed: float = 0.0,
) -> StrokePoints:
    """Return strokes with slowly wandering noise of about 12 N; retraction has ``2 * asymmetry_n`` more friction.

    Pressure extending is above its mean by the share ``pressed``, retracting below it, and half of friction follows it.
    ``other_m`` gives the position of another cylinder from time and position; None: it stands at 0.5 m, unknown.
    """
    plan = plan or LoadPlan()
    generator = np.random.default_rng(seed)
    position_m, velocity, acceleration = motion(seconds)
    wander = np.convolve(generator.normal(0.0, 12.0, len(position_m) + 99), np.full(100, 0.1), mode="valid")
    pressure_pa = 1e7 * (1.0 + pressed * np.sign(velocity))
    asymmetry_n -= 0.5 * pressed * coulomb_n
    friction_n = coulomb_n * np.sign(velocity) - asymmetry_n + viscous_n_s_m * velocity
    time_s = STEP_S * np.arange(len(position_m))
    others_m = np.full(len(position_m), 0.5) if other_m is None else other_m(time_s, position_m)
    force_n = load_at_angle(position_m, others_m) + friction_n + wander
    usable = np.ones(len(position_m), dtype=np.bool_)
    how = pressure_pa, usable, STEP_S, plan.slowest_m_s, plan.settling_travel_m
    return stroke_points(
        force_n, position_m, velocity, acceleration, *how, None if other_m is None else others_m[:, None]
    )
