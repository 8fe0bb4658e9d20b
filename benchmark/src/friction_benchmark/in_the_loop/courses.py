"""What the loop has to follow: references [m] and loads [N], one value each millisecond, after a stroke to warm up."""

import numpy as np

from cylinder_friction.arrays import Array
from friction_benchmark.servo_rig.dynamics import TICK_S

WARM_UP_S = 5.0  # Two strokes that are not scored: estimators settle, contacts are as after work
MIDDLE_M, STROKE_M = 0.15, 5e-3
MICRO_STEP_M = 1e-4
HEAVY_N = 600.0  # Load that comes and goes
COURSES = {"slow sine": 15.0, "micro-steps": 13.5, "triangle with dwell": 17.0, "load changes": 14.0}
"""Durations [s]. Two periods of a sine of 5 mm, at most 4 mm/s; steps of 0.1 mm, up and down; strokes of 5 mm at 5 mm/s
with dwells of 3 s; smooth strokes of 60 mm at up to 75 mm/s, while a load comes in motion and goes at rest."""


def course(name: str) -> tuple[Array, Array]:
    """Return reference and load of one of ``COURSES``, after the warm-up; the reference has one value more."""
    time_s = np.arange(round(COURSES[name] / TICK_S)) * TICK_S
    load_n = np.zeros(len(time_s))
    if name == "slow sine":
        path_m = STROKE_M * np.sin(2.0 * np.pi * time_s / 7.5)
    elif name == "micro-steps":
        path_m = MICRO_STEP_M * np.repeat([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, -1.0, 0.0], 1500)
    elif name == "triangle with dwell":
        corners_s, corners = [0, 1, 2, 5, 6, 9, 10, 13, 14, 17], [0, 0, 1, 1, 0, 0, -1, -1, 0, 0]
        path_m = STROKE_M * np.interp(time_s, corners_s, corners)
    else:
        strokes = [
            (sign, np.clip((time_s - at_s) / 1.5, 0.0, 1.0)) for at_s, sign in ((0.5, 1), (3, -1), (6, 1), (9.5, -1))
        ]
        path_m = sum(0.06 * sign * part**3 * (10.0 - 15.0 * part + 6.0 * part**2) for sign, part in strokes)
        changes_s = [0.0, 1.2, 1.25, 5.25, 5.3, 6.75, 6.8, 8.6, 8.65]
        load_n = np.interp(time_s, changes_s, HEAVY_N * np.array([0, 0, 1, 1, 0, 0, 1, 1, 0]))
    warm_s = np.arange(round(WARM_UP_S / TICK_S)) * TICK_S
    warm_m = STROKE_M * np.sin(np.pi * np.minimum(warm_s, 4.0))
    return MIDDLE_M + np.concatenate([warm_m, path_m, path_m[-1:]]), np.concatenate([np.zeros(len(warm_s)), load_n])
