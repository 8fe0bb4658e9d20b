"""Friction as a function of motion: the Stribeck curve, LuGre, and their identification from labelled recordings."""

from cylinder_friction.friction_models.identification import (
    INTERVAL_METHOD,
    Identification,
    SearchEffort,
    SteadyPoint,
    identify,
    steady_points,
    with_dead_band,
)
from cylinder_friction.friction_models.lugre import (
    LUGRE_UNITS,
    LugreParameters,
    lugre_step,
    new_bristle,
    passive_damping_velocity,
    simulate,
)
from cylinder_friction.friction_models.stribeck import StribeckCurve, fit_stribeck

__all__ = [
    "INTERVAL_METHOD",
    "LUGRE_UNITS",
    "Identification",
    "LugreParameters",
    "SearchEffort",
    "SteadyPoint",
    "StribeckCurve",
    "fit_stribeck",
    "identify",
    "lugre_step",
    "new_bristle",
    "passive_damping_velocity",
    "simulate",
    "steady_points",
    "with_dead_band",
]
