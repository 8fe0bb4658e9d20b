"""Mean friction in each direction of sliding, with an interval, and the check that it is friction at all."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.inspection.friction_view import CONFIDENCE, FrictionView
from cylinder_friction.labelling.known_offset import too_uneven
from cylinder_friction.labelling.robust import RobustFit, clustered_half_widths
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.recordings.checks.limits import Finding
from cylinder_friction.recordings.columns import UNCERTAINTY_COLUMN
from cylinder_friction.wording import four_digits

WAYS = {"extending": 1.0, "retracting": -1.0}


@dataclass(frozen=True)
class MeanFriction:
    """Mean friction against the motion, over all usable rows that slide in one direction."""

    mean_n: float  # Positive if it opposes the motion [N]
    half_width_n: float  # Half the 95 % interval [N]; NaN if unknown

    def __str__(self) -> str:
        spread = f" ± {self.half_width_n:.0f}" if math.isfinite(self.half_width_n) else ""
        return f"{self.mean_n:z.0f}{spread}"


def sliding_friction(view: FrictionView) -> dict[str, MeanFriction]:
    """Average friction by direction, a key of ``WAYS``; a direction without sliding is left out.

    The interval combines the uncertainty of the sensors and of an identified load, which no averaging reduces, with the
    scatter of friction between strokes. Without a stated uncertainty of the sensors there is no interval.
    """
    direction = view.direction
    stroke = np.cumsum(np.diff(direction, prepend=direction[:1]) != 0.0)
    found = {}
    for way, sign in WAYS.items():
        rows = direction == sign
        if rows.any():
            half_n = math.nan
            if view.has_interval:
                sensors_n = float(view.labelled.column(UNCERTAINTY_COLUMN)[rows].mean())
                half_n = math.hypot(sensors_n, stroke_half_width(view.friction_n[rows], stroke[rows]))
            found[way] = MeanFriction(sign * float(view.friction_n[rows].mean()), half_n)
    return found


def stroke_half_width(values: Array, stroke: NDArray[np.int64]) -> float:
    """Compute half the interval of the mean of rows; rows of one stroke are not independent.

    A stroke is weighted by its rows, and Student's t follows from the number of strokes. The result is 0 for a single
    stroke, which shows no scatter. Both arrays have shape ``(n,)``.
    """
    every = np.ones(len(values))
    mean = RobustFit(values.mean(), every, values - values.mean())
    _, clusters = np.unique(stroke, return_inverse=True)
    return float(clustered_half_widths(every[:, None], mean, clusters, CONFIDENCE)[0]) if clusters.any() else 0.0


def friction_finding(
    view: FrictionView, friction: dict[str, MeanFriction], zero_n: float | None, plan: OffsetPlan
) -> Finding:
    """State the friction of a recording, or why none is stated: it contains a load, or drives the motion.

    ``zero_n`` is the stated standard uncertainty of the sensors' zeros as friction [N], or None; ``plan`` limits the
    asymmetry of friction.

    """
    load_n, half_n = view.load_n, view.half_difference_n
    text = ", ".join(f"{each} N {way}" for way, each in friction.items())
    if not friction:
        slowest = f"nothing slides faster than {1e3 * view.slowest_m_s:.2g} mm/s away from the end stops"
        return Finding("friction", "refused", f"{slowest}; record strokes")
    held = f"{four_digits(load_n)} N does not turn with the direction" if view.carries_load else ""
    held = held or too_uneven(load_n, half_n, zero_n, plan)
    if half_n < 0.0 or (not held and min(each.mean_n for each in friction.values()) <= 0.0):
        found = f"{half_n:z.0f} N at equal position" if half_n < 0.0 else f"{text} against the motion"
        remedy = "the position counts the other way or is disturbed, the pressures are swapped, or a load acts"
        return Finding("friction", "refused", f"friction would push the piston ({found}): {remedy}")
    if held:
        remedy = (
            "state the load (--load; ingest.load in a project) or a line's loss (sensor.line_loss), map a load cell, "
            "or zero the pressure sensors"
        )
        return Finding("friction", "refused", f"the force is not friction alone: {held}; {remedy}")
    interval = "95 %" if view.has_interval else "no interval: the sensors' accuracy is not stated"
    text = f"mean of all sliding rows: {text} ({interval})"
    if view.unknown:
        return Finding("friction", "noted", f"friction unknown: {view.unknown}; {text}, in which a load would not show")
    return Finding(
        "friction", "ok", f"friction {half_n:z.0f} N (half of extending less retracting at equal positions); {text}"
    )
