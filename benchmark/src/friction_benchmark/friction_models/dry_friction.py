"""What the compiled models share of dry friction: its fall with speed, and its direction and pressure."""

import math

import numba


@numba.njit(cache=True)
def falling_part(log_speed: float, stribeck_velocity: float, exponent: float) -> float:
    """Return ``exp(-|v / vs|**a)`` from ``ln |v|``: a search over parameters computes that logarithm once."""
    return math.exp(-math.exp(exponent * (log_speed - math.log(stribeck_velocity))))


@numba.njit(cache=True)
def side_factor(
    direction: float, retract_ratio: float, coulomb: float, pressure_slope: float, pressure: float
) -> float:
    """Return the factor on dry friction of direction and pressure; below zero gauge the seal is not relieved more."""
    factor = 1.0 + pressure_slope * max(pressure, 0.0) / coulomb
    return factor * retract_ratio if direction < 0.0 else factor
