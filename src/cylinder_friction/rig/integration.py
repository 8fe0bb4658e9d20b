"""Compiled simulation at a fixed step, linearly implicit in its stiff parts and much faster than real time.

Order within a step: flows at the old pressures; the new velocity from the momentum equation, whose stiff parts
(presliding springs, damping, end stops) use the new velocity, which makes one linear equation; the position; the
pressures with implicit slopes of the orifices; then friction elements, film, spool and oil.
"""

import inspect
import math
import sys
import zlib
from functools import cache
from typing import Any

import numba
import numpy as np

from cylinder_friction.rig import external_load as load_module
from cylinder_friction.rig import friction, hydraulics
from cylinder_friction.rig import lever as lever_module
from cylinder_friction.rig.external_load import between, load_at
from cylinder_friction.rig.friction import (
    ageing_factor,
    coulomb_friction,
    damping,
    direction_factor,
    film_rate,
    place_factor,
    strength,
    viscosity_ratio,
)
from cylinder_friction.rig.hydraulics import bulk_modulus, makeup_flow, port_a, port_b, pump_flow, stop_force
from cylinder_friction.rig.lever import hand_step, new_hand
from cylinder_friction.rig.parameters import ELEMENTS

DRIFT_STEP_S = 1.0  # Time between two values of the slow factor on Coulomb friction [s]


def compiled_run() -> Any:
    """Load or compile the simulation; its arguments are those of ``_run``."""
    return _compiled(_sources())


def _sources() -> int:
    """Hash the source of everything that ``_run`` calls."""
    called = (friction, hydraulics, lever_module, load_module, sys.modules[__name__])
    return zlib.crc32("".join(inspect.getsource(module) for module in called).encode())


@cache
def _compiled(sources: int) -> Any:
    """Load ``_run`` from Numba's cache on disk, which by itself would miss changes in other files.

    The cache's key contains the values that a function closes over, so ``sources`` is part of the key.
    """

    @numba.njit(cache=True)
    def run(
        f: Any, y: Any, script: Any, actions: Any, drift: Any, load: Any, begin: Any, timing: Any, trace: Any
    ) -> int:
        _run(f, y, script, actions, drift, load, begin, timing, trace)
        return sources

    return run


@numba.njit
def _run(f: Any, y: Any, script: Any, actions: Any, drift: Any, load: Any, begin: Any, timing: Any, trace: Any) -> None:
    """Fill ``trace``, one row per tick; ``script`` is the hand's remnant or, without ``actions``, the lever itself."""
    dt, tick_steps = timing
    scripted = len(actions) == 0
    x, p1, p2, ps, temperature, film = begin
    load_n, load_share, load_along_n = load
    v = spool = volume_1 = volume_2 = age_s = 0.0
    force = np.zeros(ELEMENTS)
    slips = np.zeros(ELEMENTS, dtype=np.bool_)
    hand = new_hand()
    lever_from = lever_to = script[0] if scripted else 0.0
    for step in range(len(trace) * tick_steps):
        time_s = step * dt
        if step % tick_steps == 0:
            tick = step // tick_steps
            lever_from = lever_to
            if scripted:
                lever_to = script[tick + 1]
            else:
                lever_to = hand_step(hand, actions, script[tick], x, y.valve_overlap, 0.5 * y.stroke_m)
        lever = lever_from + (lever_to - lever_from) * (step % tick_steps) / tick_steps

        viscosity = viscosity_ratio(f, temperature)
        slow = between(drift, time_s / DRIFT_STEP_S)
        coulomb = coulomb_friction(f, p1, p2, place_factor(f, x, y.stroke_m, slow), temperature)
        level = ageing_factor(f, age_s) * strength(f, coulomb, v, film, viscosity)
        damp = damping(f, v, viscosity)
        stop, stop_stiffness = stop_force(y, x, v)
        external = load_at(load_n, load_share, load_along_n, time_s, x, y.stroke_m)
        if step % tick_steps == 0:
            row = trace[step // tick_steps]
            row[0], row[1], row[2], row[3], row[4], row[5] = time_s, p1, p2, ps, x, v
            row[6] = force.sum() + damp * v
            row[7], row[8], row[9], row[10] = film, spool, lever, temperature
            row[11], row[12], row[13], row[14] = volume_1, volume_2, stop, slow
            row[15] = external

        flow_1, slope_1 = port_a(y, spool, ps, p1, x)
        flow_2, slope_2 = port_b(y, spool, ps, p2, x)
        make_1, make_slope_1 = makeup_flow(y, p1)
        make_2, make_slope_2 = makeup_flow(y, p2)
        leak = y.leakage_m3_s_pa / viscosity * (p1 - p2)
        pump, pump_slope = pump_flow(y, ps)

        spring = _elements_before(f, force, slips, v, level, dt)
        push = p1 * y.piston_area_m2 - p2 * y.annulus_area_m2 + stop - force.sum() - external
        v_new = (y.mass_kg * v + dt * push) / (y.mass_kg + dt * (damp + dt * (spring + stop_stiffness)))
        _elements_after(f, force, slips, v, v_new, level, dt)
        v = v_new
        x += dt * v

        rate_1 = dt * bulk_modulus(y, p1) / (y.dead_volume_1_m3 + y.piston_area_m2 * x)
        rate_2 = dt * bulk_modulus(y, p2) / (y.dead_volume_2_m3 + y.annulus_area_m2 * (y.stroke_m - x))
        rate_s = dt * bulk_modulus(y, ps) / y.supply_volume_m3
        into_1, into_2 = flow_1 + make_1 - leak, flow_2 + make_2 + leak
        into_slope_1, into_slope_2 = slope_1 + make_slope_1, slope_2 + make_slope_2
        change_1 = rate_1 * (into_1 - y.piston_area_m2 * v) / (1.0 + rate_1 * into_slope_1)
        change_2 = rate_2 * (into_2 + y.annulus_area_m2 * v) / (1.0 + rate_2 * into_slope_2)
        from_supply = (flow_1 if spool > 0.0 else 0.0) + (flow_2 if spool < 0.0 else 0.0)
        supply_slope = pump_slope + (slope_1 if spool > 0.0 else slope_2)
        volume_1 += dt * into_1 - dt * into_slope_1 * change_1
        volume_2 += dt * into_2 - dt * into_slope_2 * change_2
        p1 += change_1
        p2 += change_2
        ps += rate_s * (pump - from_supply) / (1.0 + rate_s * supply_slope)

        target, rate = film_rate(f, film, v, viscosity)
        film += (target - film) * dt * rate / (1.0 + dt * rate)
        age_s = (age_s + dt) / (1.0 + dt * abs(v) / f.renewal_m)
        spool += (lever - spool) * dt / (y.spool_lag_s + dt)
        heat = max(pump, 0.0) * ps - y.cooling_w_k * (temperature - y.room_temperature_c)
        temperature += dt * heat / y.oil_heat_capacity_j_k


@numba.njit(cache=True)
def _elements_before(f: Any, force: Any, slips: Any, velocity_m_s: float, level_n: float, dt: float) -> float:
    """Move slipping elements towards their strength; returns the stiffness of the sticking ones [N/m]."""
    spring = 0.0
    signed = math.copysign(direction_factor(f, velocity_m_s) * level_n, velocity_m_s)
    for i in range(ELEMENTS):
        if slips[i]:
            pull = dt * f.attraction_n_s
            force[i] = (force[i] + pull * math.copysign(f.share[i], velocity_m_s)) / (1.0 + pull / abs(signed))
        else:
            spring += f.stiffness_n_m[i]
    return spring


@numba.njit(cache=True)
def _elements_after(
    f: Any, force: Any, slips: Any, before_m_s: float, after_m_s: float, level_n: float, dt: float
) -> None:
    """Stretch sticking elements by the new velocity, let overstretched ones slip, and let all stick at a reversal."""
    reversed_motion = before_m_s * after_m_s <= 0.0
    for i in range(ELEMENTS):
        if slips[i]:
            slips[i] = not reversed_motion
            continue
        before_n = abs(force[i])
        force[i] += dt * f.stiffness_n_m[i] * after_m_s
        limit = f.share[i] * direction_factor(f, force[i]) * level_n
        if force[i] * after_m_s > 0.0 and abs(force[i]) >= limit:
            slips[i] = True
            force[i] = math.copysign(max(limit, before_n), force[i])
