"""Friction as a function of motion: analytical models, and their identification from labelled recordings."""

from cylinder_friction.friction_models.catalogue import MODELS, model_named
from cylinder_friction.friction_models.coulomb_stribeck import CoulombStribeck, CoulombStribeckParameters
from cylinder_friction.friction_models.dahl import Dahl, DahlParameters
from cylinder_friction.friction_models.film_lugre import FilmLuGre, FilmLugreParameters
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
    LUGRE_STEP_MULTIPLY_ADDS,
    LUGRE_UNITS,
    LuGre,
    LugreParameters,
    lugre_step,
    new_bristle,
    passive_damping_velocity,
    simulate,
)
from cylinder_friction.friction_models.maxwell_slip import GeneralisedMaxwellSlip, MaxwellSlipParameters
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import ModelParameters, ParameterSpec
from cylinder_friction.friction_models.stribeck import StribeckCurve, fit_stribeck

__all__ = [
    "INTERVAL_METHOD",
    "LUGRE_STEP_MULTIPLY_ADDS",
    "LUGRE_UNITS",
    "MODELS",
    "CoulombStribeck",
    "CoulombStribeckParameters",
    "Dahl",
    "DahlParameters",
    "FilmLuGre",
    "FilmLugreParameters",
    "FrictionModel",
    "GeneralisedMaxwellSlip",
    "Identification",
    "LuGre",
    "LugreParameters",
    "MaxwellSlipParameters",
    "ModelParameters",
    "ParameterSpec",
    "SearchEffort",
    "SteadyPoint",
    "StribeckCurve",
    "fit_stribeck",
    "identify",
    "lugre_step",
    "model_named",
    "new_bristle",
    "passive_damping_velocity",
    "simulate",
    "steady_points",
    "with_dead_band",
]
