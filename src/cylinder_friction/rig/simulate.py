"""The simulation: parameters, lever and load in, a trace out. ``integration`` has the equations."""

import math
from dataclasses import astuple, dataclass

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.rig.external_load import ExternalLoad
from cylinder_friction.rig.integration import compiled_run
from cylinder_friction.rig.lever import TICK_S, DutyCycle
from cylinder_friction.rig.parameters import DEFAULT_STEP_S, RigParameters, friction_constants, hydraulic_constants

LEAST_START_PA = 2e5  # Least pressure on the piston side at the start if a load pulls the rod out [Pa]
TRACE_COLUMNS = (
    "time_s",
    "pressure_1_pa",
    "pressure_2_pa",
    "supply_pressure_pa",
    "position_m",
    "velocity_m_s",
    "friction_n",
    "film",
    "spool",
    "lever",
    "oil_temperature_c",
    "volume_1_m3",
    "volume_2_m3",
    "stop_force_n",
    "drift",
    "load_force_n",
)


@dataclass(frozen=True)
class RigState:
    """The start of a simulation: at rest, all friction elements relaxed and sticking."""

    position_m: float
    pressure_1_pa: float  # Piston side [Pa]
    pressure_2_pa: float  # Rod side [Pa]
    supply_pressure_pa: float
    oil_temperature_c: float = 40.0
    film: float = 0.0  # Lubricant film, 0 after a long dwell [-]


def balanced_state(
    rig: RigParameters, position_m: float, pressure_2_pa: float, oil_temperature_c: float, load_force_n: float = 0.0
) -> RigState:
    """Make a state at rest in which the oil pushes as hard as the load resists.

    If a load pulls the rod out, the pressure on the rod side is raised until the piston side has at least 2 bar.
    """
    y = rig.hydraulics
    least_pa = (LEAST_START_PA * y.piston_area_m2 - load_force_n) / y.annulus_area_m2
    pressure_2_pa = max(pressure_2_pa, least_pa) if load_force_n < 0.0 else pressure_2_pa
    pressure_1_pa = pressure_2_pa * y.annulus_area_m2 / y.piston_area_m2 + load_force_n / y.piston_area_m2
    return RigState(position_m, pressure_1_pa, pressure_2_pa, y.pump_pressure_pa, oil_temperature_c)


def simulate(
    rig: RigParameters,
    lever: DutyCycle | Array,
    start: RigState,
    duration_s: float,
    drift: Array | None = None,
    time_step_s: float = DEFAULT_STEP_S,
    external_force: ExternalLoad | None = None,
) -> pd.DataFrame:
    """Simulate the rig without its sensors; the trace has one row each millisecond, columns ``TRACE_COLUMNS``.

    Args:
        lever: An operator's duty cycle, or the lever itself, one value each millisecond, -1 to 1.
        drift: Slow factor on Coulomb friction, one value per second; None means 1 throughout.
        time_step_s: Step of the integration [s]; must divide one millisecond.
        external_force: Load on the rod, positive if it resists extension. None means no load.

    Raises:
        ValueError: Two times do not fit together, the lever or the load is too short, or the state is no longer finite.
    """
    tick_steps = whole_steps(TICK_S, time_step_s, "the operator's tick of 0.001 s", "time_step_s")
    rows = whole_steps(duration_s, TICK_S, "duration_s", "the operator's tick")
    ticks = rows + 2
    if drift is None:
        drift = np.ones(2)
    cycle = lever if isinstance(lever, DutyCycle) else DutyCycle(np.zeros((0, 10)), lever)
    script = np.asarray(cycle.remnant, dtype=np.float64)
    if len(script) < ticks:
        raise ValueError(f"lever: got {len(script)} values, but {duration_s} s need {ticks}, one each millisecond")
    load = external_force or ExternalLoad.of_time(np.zeros(ticks))
    if len(load.force_n) < ticks:
        raise ValueError(
            f"external_force: got {len(load.force_n)} values, but {duration_s} s need {ticks}, one each millisecond"
        )
    trace = np.empty((rows, len(TRACE_COLUMNS)))
    compiled_run()(
        friction_constants(rig.friction),
        hydraulic_constants(rig.hydraulics),
        script,
        np.asarray(cycle.actions, dtype=np.float64),
        np.asarray(drift, dtype=np.float64),
        tuple(np.ascontiguousarray(part, dtype=np.float64) for part in (load.force_n, load.share, load.along_n)),
        astuple(start),
        (time_step_s, tick_steps),
        trace,
    )
    if not np.isfinite(trace[-1]).all():
        raise ValueError(
            f"the simulation ceased to be finite; time_step_s of {time_step_s} s is too long, make it smaller"
        )
    return pd.DataFrame(trace, columns=list(TRACE_COLUMNS))


def whole_steps(long: float, short: float, long_name: str, short_name: str) -> int:
    """Divide a time by a shorter one [s]; raise ``ValueError`` with both names unless it is a multiple."""
    count = round(long / short)
    if count < 1 or not math.isclose(count * short, long, rel_tol=1e-9):
        raise ValueError(f"{long_name}: got {long} s, but expected a multiple of {short_name}, {short} s")
    return count
