"""The friction models that a saved estimator may hold, by name."""

from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.friction_models.model import FrictionModel

MODELS: dict[str, FrictionModel] = {model.name: model for model in (LuGre(), LuGre(pressure_scaled=True))}
"""LuGre, plain and with dry friction that grows with pressure; a model holds no state, so one of each is enough."""


def model_named(name: str) -> FrictionModel:
    """Look up a friction model by its name, as saved estimators state it: ``lugre`` or ``pressure_lugre``.

    The model holds no state, so one instance serves all callers.

    Raises:
        ValueError: There is none of that name; the message lists the known names.

    Example:
        >>> from cylinder_friction.friction_models.catalogue import model_named
        >>> model_named("pressure_lugre").title
        'LuGre, pressure-scaled'
    """
    if name not in MODELS:
        raise ValueError(f"friction model is {name!r}, but expected one of {sorted(MODELS)}")
    return MODELS[name]
