"""What one session tells about load and moving mass, collected recording by recording."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from cylinder_friction.labelling.load import LoadIdentification, LoadPlan, identify_load
from cylinder_friction.labelling.motion import (
    MotionIdentification,
    MotionPlan,
    MotionPoints,
    identify_motion,
    motion_points,
)
from cylinder_friction.labelling.strokes import StrokePoints, stroke_points

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_LOAD_ORDER = 4
"""Of the polynomial that stands for the load while the mass is identified."""


@dataclass(frozen=True)
class SessionFound:
    """What was identified in one session, and the mass that its labels use.

    Attributes:
        moving_mass_kg: The identified one where the motion tells it, else the given one [kg].
        load: None where the load was not to be identified.
        motion: None where the mass was not to be identified.
    """

    moving_mass_kg: float
    load: LoadIdentification | None = None
    motion: MotionIdentification | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as JSON takes it."""
        return {
            "moving_mass_kg": self.moving_mass_kg,
            "load": None if self.load is None else self.load.to_dict(),
            "motion": None if self.motion is None else self.motion.to_dict(),
        }


@dataclass
class SessionPoints:
    """Collects strokes and blocks, so that memory holds means of a session and never its recordings.

    Attributes:
        given_mass_kg: The cylinder's moving mass as it was given [kg].
        load_plan: How to identify the load; None where it is not to be.
        motion_plan: How to identify the mass; None where it is not to be.
    """

    given_mass_kg: float
    load_plan: LoadPlan | None
    motion_plan: MotionPlan | None
    _strokes: list[StrokePoints] = field(default_factory=list)
    _blocks: list[MotionPoints] = field(default_factory=list)

    def add(
        self,
        force_n: Array,
        position_m: Array,
        velocity_m_s: Array,
        acceleration_m_s2: Array,
        usable: NDArray[np.bool_],
        sample_time_s: float,
    ) -> None:
        """Add one recording.

        Args:
            force_n: Smooth drive force less whatever load is known, inertia still in it [N], shape ``(n,)``.
            position_m, velocity_m_s, acceleration_m_s2: Shape ``(n,)``.
            usable: Rows away from the end stops and the edges, shape ``(n,)``.
            sample_time_s: Time between two rows [s].
        """
        signals = (force_n, position_m, velocity_m_s, acceleration_m_s2)
        if self.load_plan is not None:
            plan = self.load_plan
            points = stroke_points(*signals, usable, sample_time_s, plan.slowest_m_s, plan.settling_travel_m)
            self._strokes.append(points)
        if self.motion_plan is not None:
            self._blocks.append(motion_points(*signals, sample_time_s, self.motion_plan, usable))

    def found(self) -> SessionFound:
        """Return what the session tells.

        The mass comes first, beside a load of any smooth shape; the load then, less the inertia of that mass where
        the motion tells it, else of the given one.

        Raises:
            RecordingError: The session does not tell the load, or hardly moves.
        """
        mass_kg, load, motion = self.given_mass_kg, None, None
        if self.motion_plan is not None:
            order = 0 if self.load_plan is None else _LOAD_ORDER
            motion = identify_motion(MotionPoints.joined(self._blocks), self.motion_plan.confidence, order)
            mass_kg = motion.mass_kg if motion.mass_known else mass_kg
        if self.load_plan is not None:
            load = identify_load(_less_inertia(StrokePoints.joined(self._strokes), mass_kg), self.load_plan)
        return SessionFound(mass_kg, load, motion)


def _less_inertia(strokes: StrokePoints, mass_kg: float) -> StrokePoints:
    return replace(strokes, force_n=strokes.force_n - mass_kg * strokes.acceleration_m_s2)
