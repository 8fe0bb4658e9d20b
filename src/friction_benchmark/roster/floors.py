"""The floors: what costs next to nothing, and therefore what every other participant has to beat."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator
from friction_benchmark.models.by_direction import ConstantByDirectionEstimator, CoulombViscousLineEstimator
from friction_benchmark.roster.entry import (
    Making,
    RosterEntry,
    needs_only_position,
    needs_raw_pressures,
)

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator


def _low_pass(making: Making) -> FrictionEstimator:
    """Effort cuts nothing."""
    return LowPassForceBalanceEstimator(making.cylinder, inputs=making.inputs)


def _hold(making: Making) -> FrictionEstimator:
    """There is nothing to learn."""
    return ForceBalanceEstimator(making.cylinder, "none", making.inputs)


def _constant(making: Making) -> FrictionEstimator:
    """Effort cuts nothing."""
    return ConstantByDirectionEstimator(making.inputs)


def _line(making: Making) -> FrictionEstimator:
    """Effort cuts nothing."""
    return CoulombViscousLineEstimator(making.inputs)


ENTRIES: tuple[RosterEntry, ...] = (
    RosterEntry(
        name="low_pass",
        title="Force balance behind a tuned low-pass",
        family="baseline",
        source="equation of motion; Jelali and Kroll 2003",
        make=_low_pass,
        can=needs_raw_pressures,
        chosen=(
            "First order; its weight is the best for the task's own target. Taught on a target that lies ahead it is "
            "the last value held, filtered as well as one weight can."
        ),
    ),
    RosterEntry(
        name="hold",
        title="Force balance of this sample, held",
        family="baseline",
        source="equation of motion; Jelali and Kroll 2003",
        make=_hold,
        can=needs_raw_pressures,
        chosen="Unfiltered, without inertia; a forecast by it says that friction stays as it is.",
    ),
    RosterEntry(
        name="constant_by_direction",
        title="One constant a direction",
        family="baseline",
        source="Coulomb friction",
        make=_constant,
        can=needs_only_position,
        chosen=(
            "The median friction while extending, while retracting, and at rest after either; motion is told from "
            "noise by a play of 0.06 mm."
        ),
    ),
    RosterEntry(
        name="coulomb_viscous_line",
        title="Coulomb and viscous friction, a straight line",
        family="baseline",
        source="Coulomb and viscous friction",
        make=_line,
        can=needs_only_position,
        chosen="Least squares on direction and velocity; at rest the mean after either direction; no Stribeck.",
    ),
)
