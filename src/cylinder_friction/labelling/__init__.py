"""Labels: friction from the equation of motion, the rows that may be used, and how wrong the label is."""

from cylinder_friction.labelling.audit import Audit, AuditRow
from cylinder_friction.labelling.equation_of_motion import Stiffness, StiffnessMode, friction_label
from cylinder_friction.labelling.events import event_masks
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.masks import usable_rows

__all__ = [
    "Audit",
    "AuditRow",
    "Labeller",
    "Stiffness",
    "StiffnessMode",
    "event_masks",
    "friction_label",
    "usable_rows",
]
