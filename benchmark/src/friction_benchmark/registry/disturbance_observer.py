"""The Kalman filter with friction and bias states; effort cuts its own search for the noises, and the recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.disturbance_observer import DisturbanceObserver
from friction_benchmark.registry.model import RegisteredModel, needs_raw_pressures

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> DisturbanceObserver:
    return DisturbanceObserver(
        build.cylinder,
        build.inputs,
        evaluations=build.share(600, 2),
        recordings=max(2, round(24 * build.effort**0.5)),
    )


MODELS = (
    RegisteredModel(
        name="disturbance_observer",
        title="Kalman filter with friction and pressure-bias states",
        family="modern",
        source="Friedland 1969; Davison 1972",
        build=_build,
        supports=needs_raw_pressures,
        chosen="Friction law over speed and pressure fitted to sliding; sensor errors measured on the training "
        "recordings; all other noises found by its own search for the least error, so nothing else is tuned.",
    ),
)
