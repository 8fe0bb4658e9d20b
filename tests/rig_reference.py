"""The rig solved by SciPy's stiff Radau method, the reference for the fixed-step simulation.

Every switch of a friction element between sticking and slipping is found as an event, where the solver restarts.
Orders of magnitude slower than ``simulate``; it uses the same laws of oil and friction but shares no line of the
integration. Compiled anew in each process: numba's cache on disk would miss changes of those laws in other files.
"""

import math
from typing import Any

import numba
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cylinder_friction.rig.external_load import ExternalLoad, load_at
from cylinder_friction.rig.friction import (
    coulomb_friction,
    damping,
    direction_factor,
    film_rate,
    place_factor,
    strength,
    viscosity_ratio,
)
from cylinder_friction.rig.hydraulics import bulk_modulus, makeup_flow, port_a, port_b, pump_flow, stop_force
from cylinder_friction.rig.lever import TICK_S
from cylinder_friction.rig.parameters import ELEMENTS, RigParameters, friction_constants, hydraulic_constants
from cylinder_friction.rig.simulate import RigState

PRESSURE_1, PRESSURE_2, SUPPLY, POSITION, VELOCITY, FILM, SPOOL, OIL = range(8)
FORCES = slice(8, 8 + ELEMENTS)
SCALE = np.array([1e6, 1e6, 1e6, 1e-2, 1e-2, 1.0, 1.0, 1.0, *[100.0] * ELEMENTS])
"""What is large and small for each state, so that one absolute tolerance serves them all."""


def solve_reference(
    rig: RigParameters,
    lever: NDArray[np.float64],
    start: RigState,
    duration_s: float,
    tolerance: float = 1e-7,
    log_step_s: float = TICK_S,
    external_force: ExternalLoad | None = None,
) -> pd.DataFrame:
    """Return pressures, position, velocity and friction, one row each ``log_step_s``; arguments as ``simulate``.

    Raises:
        RuntimeError: The solver gave up.
    """
    f, y = friction_constants(rig.friction), hydraulic_constants(rig.hydraulics)
    lever = np.asarray(lever, dtype=np.float64)
    none = np.zeros(2)
    load = (none, none, none)
    if external_force is not None:
        load = (external_force.force_n, external_force.share, external_force.along_n)
    state = np.zeros(8 + ELEMENTS)
    state[[PRESSURE_1, PRESSURE_2, SUPPLY]] = start.pressure_1_pa, start.pressure_2_pa, start.supply_pressure_pa
    state[[POSITION, FILM, OIL]] = start.position_m, start.film, start.oil_temperature_c
    slips = np.zeros(ELEMENTS, dtype=np.bool_)
    rows: list[NDArray[np.float64]] = []
    wanted_s = log_step_s * np.arange(round(duration_s / log_step_s))
    time_s = 0.0
    while time_s < duration_s:
        solution: Any = solve_ivp(
            _right_hand_side(f, y, lever, load, slips),
            (time_s, duration_s),
            state / SCALE,
            method="Radau",
            rtol=tolerance,
            atol=tolerance,
            max_step=5.0 * TICK_S,
            dense_output=True,
            events=_events(f, y, slips),
        )
        if solution.status < 0:
            raise RuntimeError(f"the reference solver stopped at {solution.t[-1]} s: {solution.message}")
        due_s = wanted_s[(wanted_s >= time_s) & (wanted_s < solution.t[-1])]
        rows += [_row(f, t, solution.sol(t) * SCALE) for t in due_s]
        state, time_s = solution.y[:, -1] * SCALE, float(solution.t[-1])
        found = np.array([len(times) > 0 for times in solution.t_events])
        # All that slip share one velocity: when one sticks, all do.
        slips = np.zeros(ELEMENTS, dtype=np.bool_) if (found & slips).any() else slips | found
    columns = ["time_s", "pressure_1_pa", "pressure_2_pa", "position_m", "velocity_m_s", "friction_n", "film"]
    return pd.DataFrame(rows, columns=columns)


@numba.njit
def _level(f: Any, y: Any, state: Any) -> float:
    """Return the Stribeck strength [N], the mean of both directions."""
    place = place_factor(f, state[POSITION], y.stroke_m, 1.0)
    coulomb = coulomb_friction(f, state[PRESSURE_1], state[PRESSURE_2], place, state[OIL])
    return strength(f, coulomb, state[VELOCITY], state[FILM], viscosity_ratio(f, state[OIL]))


@numba.njit
def _derivatives(f: Any, y: Any, lever: Any, load: Any, slips: Any, time_s: float, state: Any) -> Any:
    p1, p2, ps, x, v, film, spool, oil = state[:8]
    tick = int(time_s / TICK_S)
    command = lever[tick] + (lever[tick + 1] - lever[tick]) * (time_s / TICK_S - tick)
    viscosity = viscosity_ratio(f, oil)
    flow_1, _ = port_a(y, spool, ps, p1, x)
    flow_2, _ = port_b(y, spool, ps, p2, x)
    make_1, _ = makeup_flow(y, p1)
    make_2, _ = makeup_flow(y, p2)
    leak = y.leakage_m3_s_pa / viscosity * (p1 - p2)
    pump, _ = pump_flow(y, ps)
    taken = flow_1 if spool > 0.0 else flow_2
    stop, _ = stop_force(y, x, v)
    friction = state[8:].sum() + damping(f, v, viscosity) * v
    target, rate = film_rate(f, film, v, viscosity)
    slope = np.empty(len(state))
    volume_1 = y.dead_volume_1_m3 + y.piston_area_m2 * x
    volume_2 = y.dead_volume_2_m3 + y.annulus_area_m2 * (y.stroke_m - x)
    slope[0] = bulk_modulus(y, p1) / volume_1 * (flow_1 + make_1 - leak - y.piston_area_m2 * v)
    slope[1] = bulk_modulus(y, p2) / volume_2 * (flow_2 + make_2 + leak + y.annulus_area_m2 * v)
    slope[2] = bulk_modulus(y, ps) / y.supply_volume_m3 * (pump - taken)
    slope[3] = v
    external = load_at(load[0], load[1], load[2], time_s, x, y.stroke_m)
    slope[4] = (p1 * y.piston_area_m2 - p2 * y.annulus_area_m2 + stop - friction - external) / y.mass_kg
    slope[5] = (target - film) * rate
    slope[6] = (command - spool) / y.spool_lag_s
    slope[7] = (max(pump, 0.0) * ps - y.cooling_w_k * (oil - y.room_temperature_c)) / y.oil_heat_capacity_j_k
    level = _level(f, y, state)
    for i in range(ELEMENTS):
        force = state[8 + i]
        if slips[i]:
            # Its sign is that of the motion, and stays smooth when a trial step overruns the reversal.
            held = math.copysign(f.share[i], force)
            slope[8 + i] = f.attraction_n_s * (held - force / (level * direction_factor(f, force)))
        else:
            slope[8 + i] = f.stiffness_n_m[i] * v
    return slope


@numba.njit
def _over_limit(f: Any, y: Any, state: Any, i: int) -> float:
    """Return by how much an element's force exceeds what it can hold [N]; negative while the motion relieves it."""
    force = state[8 + i]
    if force * state[VELOCITY] <= 0.0:
        return -1.0
    excess: float = abs(force) - f.share[i] * direction_factor(f, force) * _level(f, y, state)
    return excess


def _right_hand_side(f: Any, y: Any, lever: NDArray[np.float64], load: Any, slips: NDArray[np.bool_]) -> Any:
    """Return the scaled derivatives while these elements slip."""

    def slope(time_s: float, scaled: NDArray[np.float64]) -> Any:
        return _derivatives(f, y, lever, load, slips, time_s, scaled * SCALE) / SCALE

    return slope


def _events(f: Any, y: Any, slips: NDArray[np.bool_]) -> list[Any]:
    """Return one event an element: a sticking one reaches its limit, a slipping one reverses."""

    def event(i: int) -> Any:
        def reverses(_: float, z: NDArray[np.float64]) -> float:
            return float(z[VELOCITY])

        def yields(_: float, z: NDArray[np.float64]) -> float:
            return float(_over_limit(f, y, z * SCALE, i))

        found: Any = reverses if slips[i] else yields
        found.terminal = True
        found.direction = 0.0 if slips[i] else 1.0
        return found

    return [event(i) for i in range(ELEMENTS)]


def _row(f: Any, time_s: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
    v = state[VELOCITY]
    friction = state[FORCES].sum() + damping(f, v, viscosity_ratio(f, state[OIL])) * v
    return np.array([time_s, state[PRESSURE_1], state[PRESSURE_2], state[POSITION], v, friction, state[FILM]])
