"""The neural friction compensator of Machado et al. 2006."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.machado import MachadoEstimator, MachadoPlan
from friction_benchmark.registry.model import OneOf, Range, RegisteredModel

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> MachadoEstimator:
    plan = MachadoPlan(
        nodes=build.whole("nodes"),
        delay=build.whole("delay"),
        penalty=build.number("penalty"),
        iterations=build.share(3_200),
    )
    return MachadoEstimator(build.cylinder, build.inputs, plan, build.seed)


MODELS = (
    RegisteredModel(
        name="machado",
        title="Neural friction compensator",
        family="related work",
        source="Machado et al. 2006",
        build=_build,
        space={"nodes": Range(6, 20, integer=True), "delay": OneOf((1, 4, 10, 20)), "penalty": Range(1e-5, 1e-1, True)},
        defaults={"nodes": 10, "delay": 10, "penalty": 1e-4},
        chosen="labels as targets; stiction force: the force balance below 3 mm/s, the side of the last motion where "
        "no pressure is measured; the task's other columns are inputs too; corrects the force balance where raw "
        "pressures are there; L-BFGS on 24,000 rows; effort cuts its iterations (3200)",
    ),
)
