"""The servo rig's equations, compiled; one module, because numba's cache on disk sees changes of one file alone.

Hydraulics: four-way valve with four metering edges, ``Q = K·o·sgn(Δp)·(√(|Δp| + δ) - √δ)``, a spool of second order,
leakage past the piston, oil with free air (Nykänen, Esqué and Ellman, 2000: volumes of liquid and gas add).

Friction: elasto-plastic elements in parallel (Iwan, 1966), each with its stiffness, yielding at its share of the
strength ``S±``. Every seal has a contact pressure ``q`` - the piston's from ``|p1 - p2|``, the rod's from ``p2`` - and

    S = D(q)·[m + (1 - m)·χ·ψ],   χ = 1 / (1 + (H/H0)²),   ψ = 1 + b·ln(1 + θ/θ0),   dθ/dt = 1 - |v|·θ/d

with the Hersey number ``H ∝ η·|v|/q``, behind a lag, and contacts of age ``θ`` (Dieterich, 1979), so that breakaway
grows with the logarithm of the dwell. The film's shear grows with the root of ``η·|v|·q`` (inverse hydrodynamic
lubrication). Viscosity is Vogel's of an ISO VG 46 oil. Friction is positive when it opposes positive velocity.
"""

import math
from typing import Any

import numba
import numpy as np

ELEMENTS = 8
P1, P2, X, V, SPOOL, SPOOL_RATE, FILM, CONTACT_AGE, VOLUME_1, VOLUME_2, ELEMENT_FORCES = range(11)
"""Places of the state: pressures, position, velocity, spool and its rate, lagging speed of the film, contacts' age,
volumes that flowed in, and the first of the elements' forces."""
TICK_S = 1e-3  # The controller's cycle, and the time between two rows of a trace [s]
BAR_PA = 1e5
ATMOSPHERE_PA = 1.013e5
POLYTROPIC = 1.3
REFERENCE_CONTACT_BAR, REFERENCE_VELOCITY_M_S, REFERENCE_C = 50.0, 0.1, 40.0
ROOT_SHIFT = 0.01
"""Below this share of the reference velocity the film's shear is proportional to velocity, not to its root."""
VOGEL_K, VOGEL_C = 838.7, 95.0  # Of ISO VG 46: 46 mm²/s at 40 °C, 6.8 mm²/s at 100 °C
POSITION_STEP_M = 0.3 / 2**16  # The controller reads the position in these steps


@numba.njit(cache=True)
def viscosity_ratio(oil_c: float) -> float:
    """Return the oil's viscosity over that at 40 °C (Vogel)."""
    return math.exp(VOGEL_K / (oil_c + VOGEL_C) - VOGEL_K / (REFERENCE_C + VOGEL_C))


@numba.njit(cache=True)
def bulk_modulus(drive: Any, pressure_pa: float) -> float:
    """Return the effective bulk modulus of oil with free air [Pa] at gauge pressure."""
    absolute = max(pressure_pa + ATMOSPHERE_PA, 0.05 * ATMOSPHERE_PA)
    air = drive.air_share * (ATMOSPHERE_PA / absolute) ** (1.0 / POLYTROPIC)
    liquid = 1.0 - drive.air_share
    liquid_modulus = drive.liquid_modulus_pa + drive.modulus_slope * max(pressure_pa, 0.0)
    return (air + liquid) / (air / (POLYTROPIC * absolute) + liquid / liquid_modulus)


@numba.njit(cache=True)
def opening(drive: Any, travel: float) -> float:
    """Return how far an edge is open, 0 to about 1; rounded, so that it never closes wholly."""
    past = travel - drive.overlap
    return 0.5 * (past + math.sqrt(past * past + drive.rounding * drive.rounding))


@numba.njit(cache=True)
def edge(drive: Any, open_share: float, drop_pa: float) -> tuple[float, float]:
    """Return the flow through an edge [m³/s] and its slope by the drop [m³/(s Pa)]."""
    root = math.sqrt(abs(drop_pa) + drive.laminar_pa)
    gain = drive.valve_gain * open_share
    return math.copysign(gain * (root - math.sqrt(drive.laminar_pa)), drop_pa), 0.5 * gain / root


@numba.njit(cache=True)
def contact_bar(seals: Any, p1: float, p2: float) -> tuple[float, float]:
    """Return the contact pressures of piston and rod seal [bar]."""
    across, rod = abs(p1 - p2) / BAR_PA, max(p2, 0.0) / BAR_PA
    limit = seals.saturation_bar
    return seals.piston_preload_bar + across / (1.0 + across / limit), seals.rod_preload_bar + rod / (1.0 + rod / limit)


@numba.njit(cache=True)
def strengths(
    seals: Any, p1: float, p2: float, place: float, film_m_s: float, age_s: float, viscosity: float
) -> tuple[float, float, float]:
    """Return the strength against extension and against retraction [N], and the share χ of boundary contact.

    ``place`` is -1 to 1 over the stroke, ``film_m_s`` the speed behind the film's lag, ``age_s`` the contacts' age.
    """
    piston_bar, rod_bar = contact_bar(seals, p1, p2)
    aged = 1.0 + seals.ageing * math.log1p(age_s / seals.ageing_onset_s)
    speed = viscosity * film_m_s / seals.film_velocity_m_s * REFERENCE_CONTACT_BAR
    chi_piston, chi_rod = 1.0 / (1.0 + (speed / piston_bar) ** 2), 1.0 / (1.0 + (speed / rod_bar) ** 2)
    full, rest = seals.mixed_share, 1.0 - seals.mixed_share
    bore = 1.0 + seals.taper * place + seals.barrel * place * place
    piston_n = seals.piston_n_bar * piston_bar * bore * (full + rest * chi_piston * aged)
    rod_n = seals.rod_n_bar * rod_bar * (full + rest * chi_rod * aged)
    even_n = piston_n + seals.wiper_n * (full + rest * chi_rod * aged)
    extend_n = seals.wear * (even_n + (1.0 - seals.rod_asymmetry) * rod_n)
    retract_n = seals.wear * (even_n + (1.0 + seals.rod_asymmetry) * rod_n)
    return extend_n, retract_n, 0.5 * (chi_piston + chi_rod)


@numba.njit(cache=True)
def damping(seals: Any, p1: float, p2: float, speed_m_s: float, chi: float, viscosity: float) -> float:
    """Return what multiplies the velocity [N s/m]: shear of both films, and damping of thinly lubricated contacts."""
    piston_bar, rod_bar = contact_bar(seals, p1, p2)
    over = viscosity / REFERENCE_VELOCITY_M_S
    roots = math.sqrt(over * speed_m_s + ROOT_SHIFT) + math.sqrt(ROOT_SHIFT)
    contact = math.sqrt(piston_bar / REFERENCE_CONTACT_BAR) + math.sqrt(rod_bar / REFERENCE_CONTACT_BAR)
    return seals.shear_n * contact * over / roots + seals.presliding_n_s_m * chi


@numba.njit(cache=True)
def element_shares(seals: Any) -> tuple[Any, Any]:
    """Return each element's share of the strength and its stiffness [N/m]; soft ones have the larger shares."""
    share, stiffness = np.empty(ELEMENTS), np.empty(ELEMENTS)
    ratio = (seals.softest_m / seals.stiffest_m) ** (1.0 / (ELEMENTS - 1))
    for i in range(ELEMENTS):
        share[i] = ratio ** (0.25 * i)
    share /= share.sum()
    for i in range(ELEMENTS):
        stiffness[i] = share[i] * seals.reference_n / (seals.stiffest_m * ratio**i)
    return share, stiffness


@numba.njit(cache=True)
def stretch(force: Any, share: Any, stiffness: Any, travel_m: float, extend_n: float, retract_n: float) -> None:
    """Stretch every element by a travel; what exceeds its strength yields."""
    for i in range(ELEMENTS):
        force[i] = min(max(force[i] + stiffness[i] * travel_m, -share[i] * retract_n), share[i] * extend_n)


@numba.njit(cache=True)
def command(drive: Any, reference_m: Any, tick: int, x: float, integral: float) -> tuple[float, float]:
    """Return the spool command, -1 to 1, and the integral of the error: P or PI with velocity feed-forward."""
    error = reference_m[tick] - round(x / POSITION_STEP_M) * POSITION_STEP_M
    integral += TICK_S * error
    feed = (reference_m[tick + 1] - reference_m[tick]) / TICK_S
    wanted = feed + drive.position_gain_1_s * error + drive.integral_gain_1_s2 * integral
    return min(max(wanted / (drive.extend_m_s if wanted > 0.0 else drive.retract_m_s), -1.0), 1.0), integral


@numba.njit(cache=True)
def at_rest(drive: Any, x: float, p2: float) -> Any:
    """Return the state of a piston at rest and in balance; ``P1`` to ``CONTACT_AGE`` name its places."""
    state = np.zeros(ELEMENT_FORCES + ELEMENTS)
    load = drive.gravity_n + drive.spring_n_m * x
    state[P1], state[P2], state[X], state[CONTACT_AGE] = (
        (p2 * drive.annulus_area_m2 + load) / drive.piston_area_m2,
        p2,
        x,
        1.0,
    )
    return state


@numba.njit(cache=True)
def friction_terms(seals: Any, drive: Any, state: Any, viscosity: float) -> tuple[float, float, float]:
    """Return the strength against extension and against retraction [N], and what multiplies the velocity [N s/m]."""
    p1, p2 = state[P1], state[P2]
    place = 2.0 * state[X] / drive.stroke_m - 1.0
    extend_n, retract_n, chi = strengths(seals, p1, p2, place, state[FILM], state[CONTACT_AGE], viscosity)
    return extend_n, retract_n, damping(seals, p1, p2, abs(state[V]), chi, viscosity)


@numba.njit(cache=True)
def friction_n(seals: Any, drive: Any, state: Any, viscosity: float) -> float:
    """Return the friction [N] that acts now."""
    damp = friction_terms(seals, drive, state, viscosity)[2]
    return state[ELEMENT_FORCES:].sum() + damp * state[V]


@numba.njit(cache=True)
def advance(
    seals: Any,
    drive: Any,
    elements: tuple[Any, Any],
    state: Any,
    wanted: float,
    load: float,
    viscosity: float,
    dt: float,
) -> None:
    """Advance the state by one step of the integration. ``wanted`` is the spool command; ``load`` resists extension.

    Flows are linearised about the old pressures, everything that multiplies the new velocity is taken there.
    """
    p1, p2, x, v, force = state[P1], state[P2], state[X], state[V], state[ELEMENT_FORCES:]
    omega = 2.0 * math.pi * drive.spool_hz
    extend_n, retract_n, damp = friction_terms(seals, drive, state, viscosity)
    spool_rate = (state[SPOOL_RATE] + dt * omega * omega * (wanted - state[SPOOL])) / (
        1.0 + dt * omega * (2.0 * drive.spool_damping + dt * omega)
    )
    spool = state[SPOOL] + dt * spool_rate
    there, back = opening(drive, spool), opening(drive, -spool)
    in_1, slope_in_1 = edge(drive, there, drive.supply_pa - p1)
    out_1, slope_out_1 = edge(drive, back, p1 - drive.tank_pa)
    in_2, slope_in_2 = edge(drive, back, drive.supply_pa - p2)
    out_2, slope_out_2 = edge(drive, there, p2 - drive.tank_pa)
    leakage = drive.cross_leakage / viscosity
    flow_1, slope_1 = in_1 - out_1 - leakage * (p1 - p2), slope_in_1 + slope_out_1 + leakage
    flow_2, slope_2 = in_2 - out_2 + leakage * (p1 - p2), slope_in_2 + slope_out_2 + leakage

    push = p1 * drive.piston_area_m2 - p2 * drive.annulus_area_m2 - force.sum() - load
    v = (drive.mass_kg * v + dt * push) / (drive.mass_kg + dt * damp)
    stretch(force, elements[0], elements[1], dt * v, extend_n, retract_n)
    rate_1 = dt * bulk_modulus(drive, p1) / (drive.dead_volume_m3 + drive.piston_area_m2 * x)
    rate_2 = dt * bulk_modulus(drive, p2) / (drive.dead_volume_m3 + drive.annulus_area_m2 * (drive.stroke_m - x))
    change_1 = rate_1 * (flow_1 - drive.piston_area_m2 * v) / (1.0 + rate_1 * slope_1)
    change_2 = rate_2 * (flow_2 + drive.annulus_area_m2 * v) / (1.0 + rate_2 * slope_2)
    state[VOLUME_1] += dt * (flow_1 - slope_1 * change_1)
    state[VOLUME_2] += dt * (flow_2 - slope_2 * change_2)
    state[P1], state[P2], state[X], state[V] = p1 + change_1, p2 + change_2, x + dt * v, v
    state[SPOOL], state[SPOOL_RATE] = spool, spool_rate
    state[FILM] += (abs(v) - state[FILM]) * dt / (seals.film_lag_s + dt)
    state[CONTACT_AGE] = (state[CONTACT_AGE] + dt) / (1.0 + dt * abs(v) / seals.renewal_m)


@numba.njit(cache=True)
def run(seals: Any, drive: Any, reference_m: Any, x: float, p2: float, tick_steps: int, trace: Any) -> None:
    """Fill ``trace``, one row per tick, columns ``simulate.TRACE_COLUMNS``; begins at rest and in balance."""
    dt = TICK_S / tick_steps
    elements, state = element_shares(seals), at_rest(drive, x, p2)
    integral = wanted = 0.0
    for step in range(len(trace) * tick_steps):
        tick = step // tick_steps
        oil_c = drive.oil_c + drive.warming_c_s * step * dt
        viscosity = viscosity_ratio(oil_c)
        load = drive.gravity_n + drive.spring_n_m * state[X]
        if step % tick_steps == 0:
            wanted, integral = command(drive, reference_m, tick, state[X], integral)
            row = trace[tick]
            row[0], row[1], row[2], row[3], row[4] = step * dt, state[P1], state[P2], state[X], state[V]
            row[5], row[6], row[7], row[8] = friction_n(seals, drive, state, viscosity), load, oil_c, state[SPOOL]
            row[9], row[10], row[11] = state[CONTACT_AGE], state[VOLUME_1], state[VOLUME_2]
        advance(seals, drive, elements, state, wanted, load, viscosity, dt)
