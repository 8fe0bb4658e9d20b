"""The baselines: what costs next to nothing, and therefore what every other model has to beat; effort cuts nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.estimators.baselines import baselines
from friction_benchmark.models.by_direction import ConstantByDirectionEstimator, CoulombViscousLineEstimator
from friction_benchmark.registry.model import RegisteredModel, needs_raw_pressures

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator
    from friction_benchmark.registry.model import BuildConfiguration


def _low_pass(build: BuildConfiguration) -> FrictionEstimator:
    return baselines(build.cylinder, build.inputs)["force_balance_low_pass"]


def _hold(build: BuildConfiguration) -> FrictionEstimator:
    return baselines(build.cylinder, build.inputs)["force_balance_unfiltered"]


def _constant(build: BuildConfiguration) -> FrictionEstimator:
    return ConstantByDirectionEstimator(build.inputs)


def _line(build: BuildConfiguration) -> FrictionEstimator:
    return CoulombViscousLineEstimator(build.inputs)


MODELS = (
    RegisteredModel(
        name="low_pass",
        title="Force balance behind a tuned low-pass",
        family="baseline",
        source="equation of motion; Jelali and Kroll 2003",
        build=_low_pass,
        supports=needs_raw_pressures,
        chosen="First order; its weight is the best for the task's own target. Fitted to a target that lies ahead it "
        "is the last value held, filtered as well as one weight can.",
    ),
    RegisteredModel(
        name="hold",
        title="Force balance of this sample, held",
        family="baseline",
        source="equation of motion; Jelali and Kroll 2003",
        build=_hold,
        supports=needs_raw_pressures,
        chosen="Unfiltered, without inertia; as a forecast it means that friction stays as it is.",
    ),
    RegisteredModel(
        name="constant_by_direction",
        title="One constant per direction",
        family="baseline",
        source="Coulomb friction",
        build=_constant,
        chosen="The median friction while extending, while retracting, and at rest after either; a backlash of "
        "0.06 mm separates motion from noise.",
    ),
    RegisteredModel(
        name="coulomb_viscous_line",
        title="Coulomb and viscous friction, a straight line",
        family="baseline",
        source="Coulomb and viscous friction",
        build=_line,
        chosen="Least squares on direction and velocity; at rest the mean after either direction; no Stribeck.",
    ),
)
