"""The rig's hydraulics: oil, orifices, hand-lever valve, throttle, cushions, pump, end stops.

Flows are positive into the chamber. ``y`` is ``HydraulicConstants`` throughout.
"""

import math
from typing import Any

import numba


@numba.njit(cache=True)
def bulk_modulus(y: Any, pressure_pa: float) -> float:
    """Compute the bulk modulus of oil with undissolved air [Pa] at gauge pressure.

    ``E (1 + α r^(1/n)) / (1 + α p_a^(1/n) E / [n (p_a + p)^((n+1)/n)])``, ``r = p_a / (p_a + p)``: the isothermal
    liquid and polytropic gas model of Simscape's hydraulic fluid.
    """
    # Below a fiftieth of the atmosphere the oil boils; the law is constant there.
    ratio = y.atmosphere_pa / max(y.atmosphere_pa + pressure_pa, 0.02 * y.atmosphere_pa)
    air = y.air_fraction * ratio ** (1.0 / y.polytropic_exponent)
    return (
        y.oil_modulus_pa
        * (1.0 + air)
        / (1.0 + air * ratio * y.oil_modulus_pa / (y.polytropic_exponent * y.atmosphere_pa))
    )


@numba.njit(cache=True)
def orifice(y: Any, gain: float, drop_pa: float) -> tuple[float, float]:
    """Compute the flow [m³/s] and its slope [m³/(s Pa)]: ``K √Δp``, laminar below ``laminar_pressure_pa``."""
    squared = drop_pa * drop_pa
    smooth = squared + y.laminar_pressure_pa * y.laminar_pressure_pa
    root = math.sqrt(math.sqrt(smooth))
    slope = gain * (smooth - 0.5 * squared) / (smooth * root)
    return gain * drop_pa / root, slope


@numba.njit(cache=True)
def valve_opening(y: Any, spool: float) -> float:
    """Compute the opening of the metering edges, 0 to 1; zero within the overlap of the closed centre."""
    travel = (min(abs(spool), 1.0) - y.valve_overlap) / (1.0 - y.valve_overlap)
    return travel**y.metering_exponent if travel > 0.0 else 0.0


@numba.njit(cache=True)
def cushion_gain(y: Any, distance_m: float) -> float:
    """Compute the gain of a cushion for outflow, ``distance_m`` before its end stop [m³/s/√Pa]."""
    part = min(max(distance_m / y.cushion_length_m, 0.0), 1.0)
    return y.cushion_closed_gain + (y.cushion_open_gain - y.cushion_closed_gain) * part * part


@numba.njit(cache=True)
def in_series(first: float, second: float) -> float:
    """Compute the gain of two orifices in series, so that no stiff volume between them must be simulated."""
    if first <= 0.0 or second <= 0.0:
        return 0.0
    return first * second / math.sqrt(first * first + second * second)


@numba.njit(cache=True)
def port_a(y: Any, spool: float, supply_pa: float, pressure_1_pa: float, position_m: float) -> tuple[float, float]:
    """Compute the flow into the piston side and minus its slope by pressure 1, ``(m³/s, m³/(s Pa))``."""
    opening = valve_opening(y, spool)
    if opening == 0.0:
        return 0.0, 0.0
    gain, other = y.valve_gain * opening, supply_pa
    if spool < 0.0:
        gain, other = gain * y.return_ratio_1, y.tank_pressure_pa
    drop = other - pressure_1_pa
    if drop < 0.0 and position_m < y.cushion_length_m:
        gain = in_series(gain, cushion_gain(y, position_m))
    return orifice(y, gain, drop)


@numba.njit(cache=True)
def port_b(y: Any, spool: float, supply_pa: float, pressure_2_pa: float, position_m: float) -> tuple[float, float]:
    """Compute the flow into the rod side and minus its slope by pressure 2, ``(m³/s, m³/(s Pa))``.

    Outflow passes the cushion and the throttle, inflow the check valve; both are in series with the valve.
    """
    opening = valve_opening(y, spool)
    if opening == 0.0:
        return 0.0, 0.0
    gain, other = y.valve_gain * opening, supply_pa
    if spool > 0.0:
        gain, other = gain * y.return_ratio_2, y.tank_pressure_pa
    drop = other - pressure_2_pa
    if drop > 0.0:
        return orifice(y, in_series(gain, y.check_gain), drop)
    gain = in_series(gain, y.throttle_gain)
    distance_m = y.stroke_m - position_m
    if distance_m < y.cushion_length_m:
        gain = in_series(gain, cushion_gain(y, distance_m))
    return orifice(y, gain, drop)


@numba.njit(cache=True)
def makeup_flow(y: Any, pressure_pa: float) -> tuple[float, float]:
    """Compute the flow of an anti-cavitation valve into its chamber and minus its slope by the chamber's pressure."""
    drop = y.tank_pressure_pa - y.makeup_cracking_pa - pressure_pa
    if drop <= 0.0 or y.makeup_gain == 0.0:
        return 0.0, 0.0
    return orifice(y, y.makeup_gain, drop)


@numba.njit(cache=True)
def pump_flow(y: Any, supply_pa: float) -> tuple[float, float]:
    """Compute the compensated pump's flow minus the relief valve's flow, and minus the slope of this difference."""
    part = (y.pump_pressure_pa - supply_pa) / y.compensator_band_pa
    slope = 0.0
    if 0.0 < part < 1.0:
        slope = y.pump_flow_m3_s / y.compensator_band_pa
    flow = y.pump_flow_m3_s * min(max(part, 0.0), 1.0)
    above = supply_pa - y.relief_factor * y.pump_pressure_pa
    if above > 0.0:
        flow -= y.relief_gain_m3_s_pa * above
        slope += y.relief_gain_m3_s_pa
    return flow, slope


@numba.njit(cache=True)
def stop_force(y: Any, position_m: float, velocity_m_s: float) -> tuple[float, float]:
    """Compute the force of the end stops, positive in extension [N], and the stiffness of the one touched [N/m].

    The force is ``k δ (1 + c dδ/dt)`` and never pulls (Hunt and Crossley, 1975).
    """
    if position_m < 0.0:
        depth, rate, sign = -position_m, -velocity_m_s, 1.0
    elif position_m > y.stroke_m:
        depth, rate, sign = position_m - y.stroke_m, velocity_m_s, -1.0
    else:
        return 0.0, 0.0
    stiffness = y.stop_stiffness_n_m * max(1.0 + y.stop_damping_s_m * rate, 0.0)
    return sign * stiffness * depth, stiffness
