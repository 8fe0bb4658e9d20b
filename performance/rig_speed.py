"""How fast the rig is simulated, beside SciPy's stiff solver on the same motion in the same run.

Usage: python performance/rig_speed.py [seconds]
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

os.environ.setdefault("NUMBA_NUM_THREADS", "1")
sys.path.append(str(Path(__file__).parents[1] / "tests"))  # the reference solution

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.duty_cycles import duty_cycle
from cylinder_friction.rig.parameters import THROTTLE_GAINS, default_rig
from cylinder_friction.rig.simulate import balanced_state, simulate
from rig_reference import solve_reference

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd


def main() -> None:
    """Print simulated seconds per second of both."""
    duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    rig = default_rig(
        Cylinder(
            name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
        )
    ).with_throttle(THROTTLE_GAINS["3"])
    start = balanced_state(rig, 0.12, 10e5, 35.0)
    hand = duty_cycle(rig, np.random.default_rng(0), duration_s)
    simulate(rig, hand, start, 1.0)  # compiles
    seconds, trace = _timed(lambda: simulate(rig, hand, start, duration_s))
    sys.stdout.write(f"fixed step, 50 µs:     {duration_s / seconds:8.1f} simulated seconds per second\n")

    short_s = min(duration_s, 5.0)
    lever = trace["lever"].to_numpy()
    solve_reference(rig, lever, start, 0.01, 1e-5)  # compiles
    seconds, solved = _timed(lambda: solve_reference(rig, lever, start, short_s, 1e-5))
    sys.stdout.write(f"SciPy Radau, tol 1e-5: {short_s / seconds:8.1f} simulated seconds per second\n")
    again = simulate(rig, lever, start, short_s)
    difference_n = float((again["friction_n"] - solved["friction_n"]).abs().mean())
    sys.stdout.write(f"mean difference in friction over {short_s:.0f} s: {difference_n:.2f} N\n")


def _timed(work: Callable[[], pd.DataFrame]) -> tuple[float, pd.DataFrame]:
    began = time.perf_counter()
    result = work()
    return time.perf_counter() - began, result


if __name__ == "__main__":
    main()
