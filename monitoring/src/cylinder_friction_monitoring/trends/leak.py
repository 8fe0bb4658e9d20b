"""Estimate the leak past the piston from oil that moves between the chambers while the valve is closed.

While no oil flows through the ports, leak and displacement change each chamber's pressure:

    V1/β · dP1/dt = -q - A1·v        V2/β · dP2/dt = q + A2·v        q = k·(P1 - P2)

The piston creeps more slowly than a sensor resolves, but it compresses the oil. So v is eliminated:

    (V1·dP1/dt / A1 + V2·dP2/dt / A2) / β = q·(1/A2 - 1/A1)

β and the oil beside the stroke are not measured; the fleet file states them. A valve that leaks to the tank looks the
same; only a shut-off valve separates the two.
"""

from collections.abc import Sequence

import numpy as np

from cylinder_friction import Cylinder, Recording
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.signals.motion import standstill_rows
from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.plan import IndicatorPlan
from cylinder_friction_monitoring.trends.session_row import Indicator

LEAST_HOLDS = 3
PIECE_S, EARLIER_S = 0.1, 0.2
"""Time over which pressures are averaged, and least time by which rest begins before it is detected [s]."""
LEAST_DIFFERENCE_PA = 0.5e5
"""Least pressure difference of a hold that shows a leak [Pa]; zeros of sensors may cause a smaller one."""
_SEED = 21


def leak(recordings: Sequence[Recording], cylinder: Cylinder, plan: IndicatorPlan) -> Indicator:
    """Estimate the leak past the piston, k [m³/(s Pa)], from the holds of a session."""
    if any(name not in recording.columns for recording in recordings for name in PRESSURES):
        return Indicator(None, why="a leak needs both pressures")
    holds = [hold for recording in recordings for hold in _holds(recording, cylinder, plan)]
    if len(holds) < LEAST_HOLDS:
        return Indicator(
            None,
            why=f"{len(holds)} holds of 0.6 s with a pressure difference of "
            f"{LEAST_DIFFERENCE_PA / 1e5:g} bar; {LEAST_HOLDS} are needed: close the valve for 2 s in mid-stroke",
        )
    moved, driven = np.array(holds).T
    picks = np.random.default_rng(_SEED).integers(0, len(holds), (plan.bootstrap, len(holds)))
    drawn = (moved * driven)[picks].sum(axis=1) / (driven**2)[picks].sum(axis=1)
    value = float(moved @ driven / (driven @ driven))
    assumed = (
        f"its size rests on a bulk modulus of {plan.bulk_modulus_pa / 1e9:g} GPa and {1e6 * plan.dead_volume_m3:g} cm³ "
        "of oil beside each chamber's stroke, as fleet.yaml states or by default; a leaking valve is included"
    )
    return Indicator(value, float(drawn.std(ddof=1)), assumed)


def _holds(recording: Recording, cylinder: Cylinder, plan: IndicatorPlan) -> list[tuple[float, float]]:
    """Compute for each hold the oil that changed sides [m³] and the integral of the pressure difference [Pa s]."""
    step_s, position_m = recording.sample_time_s, recording.column("position_m")
    pressures = [recording.column(name) for name in PRESSURES]
    areas = cylinder.piston_area_m2, cylinder.annulus_area_m2
    rest = standstill_rows(position_m, step_s)
    size = max(2, round(PIECE_S / step_s))
    holds = []
    edges = np.flatnonzero(np.diff(rest, prepend=False, append=False))
    for first, last in edges.reshape(-1, 2):
        if last - first < 3 * size:
            continue
        own = slice(max(first - round(EARLIER_S / step_s), 0), last)
        difference_pa = pressures[0][own] - pressures[1][own]
        if abs(difference_pa[:size].mean()) < LEAST_DIFFERENCE_PA:
            continue
        at_m = float(position_m[own].mean())
        volumes = (plan.dead_volume_m3 + areas[0] * at_m, plan.dead_volume_m3 + areas[1] * (cylinder.stroke_m - at_m))
        rises = [_rise(values[own], size) for values in pressures]
        parts = [volume * rise / area for volume, rise, area in zip(volumes, rises, areas, strict=True)]
        moved = sum(parts) / plan.bulk_modulus_pa / (1.0 / areas[1] - 1.0 / areas[0])
        middle = difference_pa[size // 2 : len(difference_pa) - size // 2]
        holds.append((moved, float(middle.sum()) * step_s))
    return holds


def _rise(values: Array, size: int) -> float:
    return float(values[-size:].mean() - values[:size].mean())
