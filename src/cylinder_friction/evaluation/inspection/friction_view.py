"""Friction of one recording for the inspection: filtered, balanced, and summarised in a Stribeck curve."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.identification.steady_points import (
    StribeckPoint,
    known_curve,
    steady_sliding_by_speed,
)
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.labelling.equation_of_motion import drive_force
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.sliding_blocks import OffsetPlan, holds_load, unknown_friction, up_and_down
from cylinder_friction.recordings.columns import UNCERTAINTY_COLUMN
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import direction_of_motion, noise_rms, standstill_rows
from cylinder_friction.signals.noise import sensor_noise
from cylinder_friction.signals.smooth_signals import (
    SignalFilter,
    SmoothDrive,
    SmoothSignals,
    filtered,
    has_pressures,
    pulse_responses,
    signals_of,
)

NOISE_MULTIPLE = 4.0
"""Limit of standstill, in standard deviations of the velocity's noise."""

PRESSURE_FORCE = "P1·A1 - P2·A2"
MEASURED_FORCE = "drive force"


CONFIDENCE = 0.95  # Probability of the intervals of friction


@dataclass(frozen=True)
class FrictionView:
    """Friction of one recording, and what the inspection derives from it."""

    signals: SmoothSignals | SmoothDrive  # Smooth signals from which friction is computed
    force_name: str  # Name of ``force_n``
    labelled: Recording  # The recording with friction, velocity and usable rows
    force_n: Array  # P1·A1 - P2·A2, or the measured drive force, smooth, shape ``(n,)`` [N]
    friction_n: Array  # Shape ``(n,)`` [N], positive when it opposes positive velocity
    usable: NDArray[np.bool_]  # Rows away from end stops and from the recording's edges, shape ``(n,)``
    slowest_m_s: float  # Velocity below which a row counts as standstill [m/s]
    points: tuple[StribeckPoint, ...]  # Steady sliding by speed and direction
    curve: StribeckCurve | None  # Fitted to them; None if they do not determine one, and ``no_curve`` states why
    # Half the sum of friction in both directions at equal position, as a load would cause it [N]; NaN if the piston
    # does not pass the same positions in both directions
    load_n: float
    half_difference_n: float  # Half the difference there: friction, whatever the load is [N]
    unknown: str  # Why ``half_difference_n`` is NaN; empty if it is not
    no_curve: str  # Why there is no curve
    assumed: tuple[str, ...]  # Assumptions of the force balance, one sentence each
    load: str = ""  # The subtracted load, in words

    @property
    def carries_load(self) -> bool:
        """Whether ``friction_n`` contains a load; False if directions cannot be compared."""
        return holds_load(self.load_n, self.half_difference_n)

    @property
    def has_interval(self) -> bool:
        """Whether the sensors' uncertainty is stated, so that friction has an interval."""
        return UNCERTAINTY_COLUMN in self.labelled.columns

    @property
    def direction(self) -> Array:
        """1 while extending, -1 while retracting, 0 at standstill and in unusable rows, shape ``(n,)``."""
        return np.where(self.usable, direction_of_motion(self.signals.velocity_m_s, self.slowest_m_s), 0.0)

    @property
    def unexplained_n(self) -> float:
        """Root mean square residual of the points of steady sliding from the curve [N]; NaN without a curve."""
        if self.curve is None:
            return math.nan
        velocity_m_s, friction_n = np.array([(point.velocity_m_s, point.friction_n) for point in self.points]).T
        return float(np.sqrt(np.mean(np.square(friction_n - self.curve.friction(velocity_m_s)))))

    @property
    def friction_name(self) -> str:
        return "friction + load" if self.carries_load else "friction"


def friction_view(recording: Recording, labeller: Labeller, method: SignalFilter) -> FrictionView:
    """Compute a recording's friction as ``labeller`` labels it; load and mass are identified from it alone.

    Raises:
        ValueError: The recording is shorter than the filter, its columns and the stated load contradict each other, or
            its strokes do not determine a load that position decides.
    """
    smooth = filtered(recording, method)
    identified = labeller.identify([smooth], method) if labeller.needs_identification else None
    labelled = labeller.label(smooth, method, identified)
    load = "none" if labeller.load == "none" else "measured"
    if identified is not None and identified.load is not None:
        load = identified.load.sentence(recording, labeller.cylinder)
    signals = signals_of(smooth)
    position_m, sample_time_s = labelled.column("position_m"), labelled.sample_time_s
    friction_n, usable, support = labelled.column("friction_n"), labelled.usable(), method.support(sample_time_s)
    rest = standstill_rows(position_m, sample_time_s, max(support.before, support.after))
    at_rest_m_s = float(np.nan_to_num(noise_rms(signals.velocity_m_s, rest)))
    of_sensor_m_s = sensor_noise(position_m) * float(np.linalg.norm(pulse_responses(method, sample_time_s)[1]))
    slowest_m_s = NOISE_MULTIPLE * max(at_rest_m_s, of_sensor_m_s)
    points = tuple(rows.point_with_interval(CONFIDENCE) for rows in steady_sliding_by_speed([labelled], slowest_m_s))
    curve, no_curve = known_curve(points)
    # The rows that ``estimate`` takes, so that a log has the same friction here
    plan = OffsetPlan()
    load_n, half_n = up_and_down(position_m, signals.velocity_m_s, friction_n, usable, plan.slowest_m_s)
    if curve is not None and holds_load(load_n, half_n):
        curve, no_curve = None, f"{load_n:z.0f} N of the force do not turn with the direction, as friction would"
    return FrictionView(
        signals=signals,
        force_name=PRESSURE_FORCE if has_pressures(labelled) else MEASURED_FORCE,
        labelled=labelled,
        force_n=drive_force(signals, labeller.cylinder),
        friction_n=friction_n,
        usable=usable,
        slowest_m_s=slowest_m_s,
        points=points,
        curve=curve,
        load_n=load_n,
        half_difference_n=half_n,
        unknown="" if math.isfinite(half_n) else unknown_friction(labelled, plan, labeller.cylinder),
        no_curve=no_curve,
        assumed=_assumed(labelled, labeller, load),
        load=load,
    )


def _assumed(recording: Recording, labeller: Labeller, load: str) -> tuple[str, ...]:
    force = PRESSURE_FORCE if has_pressures(recording) else "the measured drive force"
    cylinder, spring = labeller.cylinder, labeller.stiffness.mode
    return (
        f"Friction = {force} - m·a - load, with m = {cylinder.moving_mass_kg:.4g} kg. Load: {load}. "
        f"A1 = {1e6 * cylinder.piston_area_m2:.5g} mm², A2 = {1e6 * cylinder.annulus_area_m2:.5g} mm² "
        f"({cylinder.name})." + ("" if spring == "none" else f" Stiffness: {spring}."),
        f"Left out: rows within {1e3 * labeller.end_stop_margin_m:.3g} mm of an end stop (stroke "
        f"{1e3 * cylinder.stroke_m:.4g} mm), and rows whose filter saw them or the edge of the recording.",
    )
