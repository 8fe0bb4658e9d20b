"""Identification of friction models: steady points, presliding, the joint search, and how sure it is."""

from cylinder_friction.friction_models.identification.coordinates import Coordinates
from cylinder_friction.friction_models.identification.intervals import INTERVAL_METHOD, confidence_intervals
from cylinder_friction.friction_models.identification.motion import Motion, Motions, with_dead_band
from cylinder_friction.friction_models.identification.presliding import (
    bristle_damping,
    bristle_stiffness,
    damping_velocity,
)
from cylinder_friction.friction_models.identification.procedure import Identification, SearchEffort, identify
from cylinder_friction.friction_models.identification.reversals import PreslidingStiffness, presliding_stiffness
from cylinder_friction.friction_models.identification.steady_points import SteadyPoint, steady_points, steady_rows

__all__ = [
    "INTERVAL_METHOD",
    "Coordinates",
    "Identification",
    "Motion",
    "Motions",
    "PreslidingStiffness",
    "SearchEffort",
    "SteadyPoint",
    "bristle_damping",
    "bristle_stiffness",
    "confidence_intervals",
    "damping_velocity",
    "identify",
    "presliding_stiffness",
    "steady_points",
    "steady_rows",
    "with_dead_band",
]
