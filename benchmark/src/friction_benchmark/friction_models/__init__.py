"""Friction models of the literature beside the product's LuGre, each plain and pressure-scaled."""

from cylinder_friction.friction_models import catalogue
from cylinder_friction.friction_models.model import FrictionModel
from friction_benchmark.friction_models.coulomb_stribeck import CoulombStribeck
from friction_benchmark.friction_models.dahl import Dahl
from friction_benchmark.friction_models.film_lugre import FilmLuGre
from friction_benchmark.friction_models.maxwell_slip import GeneralisedMaxwellSlip

FRICTION_MODELS: dict[str, FrictionModel] = catalogue.MODELS | {
    model.name: model
    for kind in (CoulombStribeck, Dahl, FilmLuGre, GeneralisedMaxwellSlip)
    for model in (kind(), kind(pressure_scaled=True))
}
"""Each model by name; a model holds no state, so one of each is enough."""
