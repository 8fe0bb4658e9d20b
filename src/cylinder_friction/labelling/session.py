"""Load and moving mass of one session, identified from the motion of its recordings."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from cylinder_friction.labelling.load import LoadIdentification, LoadPlan, identify_load
from cylinder_friction.labelling.mass import MotionIdentification, MotionPoints, identify_motion
from cylinder_friction.labelling.strokes import StrokePoints
from cylinder_friction.recordings.recording import RecordingError

_LOAD_ORDER = 4
"""Order of the polynomial that represents the load while the mass is identified."""


@dataclass(frozen=True)
class SessionIdentification:
    """Load and mass identified in one session, and the mass that its labels use."""

    moving_mass_kg: float  # The identified mass if the motion determines it, else the given one [kg]
    load: LoadIdentification | None = None  # None if the load was not to be identified
    motion: MotionIdentification | None = None  # None if the mass was not to be identified

    def to_dict(self) -> dict[str, Any]:
        """Collect the content as JSON-compatible values."""
        return {
            "moving_mass_kg": self.moving_mass_kg,
            "load": None if self.load is None else asdict(self.load),
            "motion": None if self.motion is None else self.motion.to_dict(),
        }


def identify_session(
    strokes: Sequence[StrokePoints],
    windows: Sequence[MotionPoints],
    given_mass_kg: float,
    load_plan: LoadPlan,
    others: tuple[str, ...] = (),
) -> SessionIdentification:
    """Identify the load and moving mass of one session.

    The mass is identified first, together with a load of any smooth shape. The load follows, after subtraction of the
    inertia of that mass if the motion determines it, otherwise of the given mass.

    Without strokes the load is not identified, without windows the mass is not. The force of the strokes includes
    inertia. ``others`` names the columns of the other positions that the load depends on.

    Raises:
        RecordingError: The strokes do not determine the load, or the session hardly moves.
    """
    if windows and others:
        raise RecordingError(
            "the moving mass cannot be identified beside a load of several positions; state it (label.inertia: given)"
        )
    mass_kg, load, motion = given_mass_kg, None, None
    if windows:
        motion = identify_motion(MotionPoints.joined(windows), load_order=_LOAD_ORDER if strokes else 2)
        mass_kg = motion.mass_kg if motion.mass_known else mass_kg
    if strokes:
        points = StrokePoints.joined(strokes)
        static = replace(points, force_n=points.force_n - mass_kg * points.acceleration_m_s2)
        load = identify_load(static, load_plan, others)
    return SessionIdentification(mass_kg, load, motion)
