"""Labels: friction from the equation of motion, load and mass, the usable rows, and how wrong the label is."""

from cylinder_friction.labelling.audit import Audit, AuditRow
from cylinder_friction.labelling.coverage import Coverage
from cylinder_friction.labelling.equation_of_motion import Stiffness, StiffnessMode, drive_force, friction_label
from cylinder_friction.labelling.events import event_masks
from cylinder_friction.labelling.label import InertiaMode, Labeller
from cylinder_friction.labelling.load import LoadIdentification, LoadPlan, identify_load
from cylinder_friction.labelling.masks import usable_rows
from cylinder_friction.labelling.motion import (
    MotionIdentification,
    MotionPlan,
    MotionPoints,
    identify_motion,
    motion_points,
)
from cylinder_friction.labelling.session import SessionFound, SessionPoints
from cylinder_friction.labelling.strokes import StrokePoints, stroke_points

__all__ = [
    "Audit",
    "AuditRow",
    "Coverage",
    "InertiaMode",
    "Labeller",
    "LoadIdentification",
    "LoadPlan",
    "MotionIdentification",
    "MotionPlan",
    "MotionPoints",
    "SessionFound",
    "SessionPoints",
    "Stiffness",
    "StiffnessMode",
    "StrokePoints",
    "drive_force",
    "event_masks",
    "friction_label",
    "identify_load",
    "identify_motion",
    "motion_points",
    "stroke_points",
    "usable_rows",
]
