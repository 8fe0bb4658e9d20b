"""A filter of learned gain, trained on the simulated twin's true friction or on the rig's own labels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.learned_gain import GainPlan, LearnedGainEstimator
from friction_benchmark.registry.model import OneOf, Range, RegisteredModel, needs_raw_pressures

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration, Space, Values

_SPACE: Space = {"nodes": OneOf((32, 48)), "learning_rate": Range(2e-3, 1e-2, logarithmic=True)}
_DEFAULTS: Values = {"nodes": 32, "learning_rate": 5e-3}
_SOURCE = "after Revach et al. 2022 (KalmanNet)"


def _build(build: BuildConfiguration) -> LearnedGainEstimator:
    """Effort cuts how many recordings training goes through, however many different ones there are."""
    return LearnedGainEstimator(
        build.cylinder,
        build.whole("nodes"),
        GainPlan(build.share(3_000), build.number("learning_rate")),
        build.inputs,
        build.seed,
    )


MODELS = (
    RegisteredModel(
        name="twin_hybrid",
        title="Hybrid trained on the twin",
        family="modern",
        source=f"{_SOURCE}; own training",
        build=_build,
        space=_SPACE,
        defaults=_DEFAULTS,
        supports=needs_raw_pressures,
        trained_on="twin",
        chosen="A filter of the force balance whose gain and offset an LSTM of one layer sets at every sample; where "
        "sensors are far off, it also sees the mean force balance of the strokes so far. Trained on true friction of "
        "random rigs, never on a recording of the rig that it is used on.",
    ),
    RegisteredModel(
        name="learned_gain",
        title="Learned gain, trained on labels",
        family="modern",
        source=_SOURCE,
        build=_build,
        space=_SPACE,
        defaults=_DEFAULTS,
        supports=needs_raw_pressures,
        chosen="The same filter and network as the hybrid trained on the twin, but trained on the rig's own labels.",
    ),
)
