"""The friction models that a saved estimator may hold, by name."""

from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.friction_models.model import FrictionModel

MODELS: dict[str, FrictionModel] = {model.name: model for model in (LuGre(), LuGre(pressure_scaled=True))}
"""All friction models by name. A model holds no state, so one instance serves all callers."""


def model_named(name: str) -> FrictionModel:
    """Look up a friction model by the name that saved estimators use: ``lugre`` or ``pressure_lugre``.

    Raises:
        ValueError: No model has that name; the message lists the known names.

    Example:
        >>> from cylinder_friction.friction_models.catalogue import model_named
        >>> model_named("pressure_lugre").title
        'LuGre, pressure-scaled'
    """
    if name not in MODELS:
        raise ValueError(f"friction model is {name!r}, but expected one of {sorted(MODELS)}")
    return MODELS[name]
