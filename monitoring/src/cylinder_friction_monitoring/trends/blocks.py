"""Average a session's steady sliding over blocks of a tenth of a second, numbered by stroke."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction import Cylinder, Recording
from cylinder_friction.recordings.columns import DRIVE_FORCE, LOAD_FORCE, OIL_TEMPERATURE, PRESSURES
from cylinder_friction.signals.motion import direction_of_motion, stroke_pieces
from cylinder_friction_monitoring.arrays import Array, Mask
from cylinder_friction_monitoring.trends.plan import IndicatorPlan


@dataclass(frozen=True)
class Blocks:
    """Means over short pieces of strokes, each of shape ``(blocks,)``."""

    force_n: Array  # Force on the rod from oil or drive, less inertia and a measured load [N]
    position_m: Array
    velocity_m_s: Array  # Extension positive, never zero
    mean_pressure_pa: Array  # Of both pressures, weighted by their areas; NaN without pressures
    pressure_1_pa: Array
    pressure_2_pa: Array
    oil_temperature_c: Array  # NaN if nothing measures it
    load_n: Array  # NaN if nothing measures it
    stroke: NDArray[np.int64]  # Counted from 0

    def select(self, rows: Mask | NDArray[np.int64]) -> Self:
        """Select some of the blocks; strokes keep their numbers."""
        return replace(self, **{each.name: getattr(self, each.name)[rows] for each in fields(self)})


def drive_force_n(recording: Recording, cylinder: Cylinder, plan: IndicatorPlan) -> Array:
    """Compute the force of oil or drive less a measured load [N], shape ``(n,)``.

    The force still contains sensor offsets and a load that depends on position; the half sum shows both.
    """
    if PRESSURES[0] in recording.columns:
        pressure_1, pressure_2 = (recording.column(name) for name in PRESSURES)
        force_n = pressure_1 * cylinder.piston_area_m2 - pressure_2 * cylinder.annulus_area_m2
    else:
        force_n = recording.column(DRIVE_FORCE)
    return force_n - recording.column(LOAD_FORCE) if plan.load == "measured" else force_n


def session_blocks(recordings: Sequence[Recording], cylinder: Cylinder, plan: IndicatorPlan) -> Blocks:
    """Cut all recordings of a session into blocks."""
    parts = [_blocks(recording, cylinder, plan) for recording in recordings]
    before = np.cumsum([0, *(1 + int(part.stroke.max(initial=-1)) for part in parts)])[:-1]
    joined = {each.name: np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Blocks)}
    joined["stroke"] = np.concatenate([part.stroke + first for part, first in zip(parts, before, strict=True)])
    return Blocks(**joined)


def _blocks(recording: Recording, cylinder: Cylinder, plan: IndicatorPlan) -> Blocks:
    velocity_m_s, step_s = recording.column("velocity_m_s"), recording.sample_time_s
    direction = np.where(recording.usable(), direction_of_motion(velocity_m_s, plan.slowest_m_s), 0.0)
    direction[np.abs(velocity_m_s) > plan.fastest_m_s] = 0.0
    size = max(1, round(plan.block_s / step_s))
    pieces = stroke_pieces(direction, step_s * np.arange(len(direction), dtype=np.float64), plan.settling_s, size)
    whole = 2 * pieces.counts >= size

    def mean(values: Array) -> Array:
        return pieces.mean(values)[whole]

    def column(name: str) -> Array:
        known = name in recording.columns
        return mean(recording.column(name)) if known else np.full(int(whole.sum()), np.nan)

    ends = pieces.rows[pieces.begins + pieces.counts - 1], pieces.rows[pieces.begins]
    acceleration = (velocity_m_s[ends[0]] - velocity_m_s[ends[1]]) / (np.maximum(pieces.counts - 1, 1) * step_s)
    pressure_1, pressure_2 = (column(name) for name in PRESSURES)
    areas = cylinder.piston_area_m2, cylinder.annulus_area_m2
    return Blocks(
        force_n=mean(drive_force_n(recording, cylinder, plan)) - cylinder.moving_mass_kg * acceleration[whole],
        position_m=column("position_m"),
        velocity_m_s=mean(velocity_m_s),
        mean_pressure_pa=(pressure_1 * areas[0] + pressure_2 * areas[1]) / sum(areas),
        pressure_1_pa=pressure_1,
        pressure_2_pa=pressure_2,
        oil_temperature_c=column(OIL_TEMPERATURE),
        load_n=column(LOAD_FORCE) if plan.load == "measured" else np.full(int(whole.sum()), np.nan),
        stroke=np.unique(pieces.stroke[whole], return_inverse=True)[1].astype(np.int64),
    )
