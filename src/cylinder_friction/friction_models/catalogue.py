"""Every analytical friction model by name."""

from cylinder_friction.friction_models.coulomb_stribeck import CoulombStribeck
from cylinder_friction.friction_models.dahl import Dahl
from cylinder_friction.friction_models.film_lugre import FilmLuGre
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.friction_models.maxwell_slip import GeneralisedMaxwellSlip
from cylinder_friction.friction_models.model import FrictionModel

MODELS: dict[str, FrictionModel] = {
    model.name: model
    for kind in (CoulombStribeck, Dahl, LuGre, FilmLuGre, GeneralisedMaxwellSlip)
    for model in (kind(), kind(pressure_scaled=True))
}
"""Each model, plain and with dry friction that grows with pressure; a model holds no state, so one of each will do."""


def model_named(name: str) -> FrictionModel:
    """Return the model; raises ``ValueError`` with the known names if there is none of that name."""
    if name not in MODELS:
        raise ValueError(f"friction model is {name!r}, but expected one of {sorted(MODELS)}")
    return MODELS[name]
