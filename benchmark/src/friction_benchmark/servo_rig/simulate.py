"""One run of the servo rig: parameters and a position reference in, a trace out."""

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from friction_benchmark.servo_rig.dynamics import TICK_S, run
from friction_benchmark.servo_rig.parameters import BAR, Drive, Seals

TRACE_COLUMNS = (
    "time_s", "pressure_1_pa", "pressure_2_pa", "position_m", "velocity_m_s", "friction_n",
    "load_force_n", "oil_temperature_c", "spool", "contact_age_s", "volume_1_m3", "volume_2_m3",
)  # fmt: skip
TICK_STEPS = 20  # Steps of the integration in a tick of 1 ms


def simulate(
    seals: Seals, drive: Drive, reference_m: Array, tick_steps: int = TICK_STEPS, start_2_pa: float = 70.0 * BAR
) -> pd.DataFrame:
    """Return the trace, one row each millisecond, columns ``TRACE_COLUMNS``; it begins at rest on the reference.

    The controller follows ``reference_m``, one value each millisecond, one more than there are rows. At first the rod
    side has the pressure ``start_2_pa``; the other side balances it and the load. A piston that meets an end stop,
    which this rig does not have, or a state that ceases to be finite raises ``ValueError``.
    """
    trace = np.empty((len(reference_m) - 1, len(TRACE_COLUMNS)))
    run(seals, drive, np.asarray(reference_m, dtype=np.float64), float(reference_m[0]), start_2_pa, tick_steps, trace)
    position_m = trace[:, TRACE_COLUMNS.index("position_m")]
    inside = (position_m > 0.0) & (position_m < drive.stroke_m)
    if not inside.all():
        late_s = TICK_S * int(np.argmin(inside))
        raise ValueError(
            f"servo rig: after {late_s:.3f} s the position is outside 0 to {drive.stroke_m} m; expected a reference "
            "that keeps clear of the ends, and a drive that can hold its load"
        )
    return pd.DataFrame(trace, columns=list(TRACE_COLUMNS))
