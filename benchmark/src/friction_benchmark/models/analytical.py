"""The analytical friction models: identification is their tuning, so nothing else of them is tuned."""

from functools import partial

from cylinder_friction.estimators.analytical import PRESSURE_PAIRS, AnalyticalEstimator, scaled_effort
from friction_benchmark.friction_models import FRICTION_MODELS
from friction_benchmark.registry import BuildConfiguration, RegisteredModel, needs_only_position

_SOURCES = {
    "stribeck": ("Armstrong-Hélouvry, Dupont and Canudas de Wit 1994", "At standstill a share, identified, is kept."),
    "dahl": ("Dahl 1968", "Exponent 1; a viscous term beside it."),
    "lugre": ("Canudas de Wit, Olsson, Åström and Lischinsky 1995", "Bristle damping from a damping ratio of 0.5."),
    "pressure_lugre": (
        "Canudas de Wit et al. 1995; pressure as in Simscape's Cylinder Friction",
        "Dry friction grows linearly with the sum of both pressures.",
    ),
    "film_lugre": (
        "Yanada and Sekikawa 2008; Tran, Hafizah and Yanada 2012",
        "With the inertia of the fluid film; bristle damping fades with speed.",
    ),
    "gms": (
        "Al-Bender, Lampaert and Swevers 2005",
        "Six elements, whose shares and travels are geometric sequences.",
    ),
}


def _build(name: str, build: BuildConfiguration) -> AnalyticalEstimator:
    """Effort cuts generations and the simulations of each local search."""
    effort = scaled_effort(build.effort, build.seed)
    return AnalyticalEstimator(build.cylinder, FRICTION_MODELS[name], build.inputs, effort=effort)


def _needs_pressures_of_some_kind(inputs: tuple[str, ...]) -> bool:
    return needs_only_position(inputs) and any(set(pair) <= set(inputs) for pair in PRESSURE_PAIRS)


MODELS = tuple(
    RegisteredModel(
        name=name,
        title=FRICTION_MODELS[name].title,
        family="analytical",
        source=source,
        build=partial(_build, name),
        supports=_needs_pressures_of_some_kind if FRICTION_MODELS[name].pressure_scaled else needs_only_position,
        chosen=chosen,
    )
    for name, (source, chosen) in _SOURCES.items()
)
