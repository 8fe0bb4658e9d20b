"""The baselines: what costs next to nothing, and therefore what every other model has to beat; effort cuts nothing."""

from collections.abc import Sequence
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.linear import labelled_rows
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.models.base import Model
from friction_benchmark.models.steady_motion import AVERAGED, VELOCITY_WINDOW, steady_motion
from friction_benchmark.registry import BuildConfiguration, RegisteredModel, needs_raw_pressures

SITUATIONS = ("extending", "retracting", "at_rest_after_extending", "at_rest_after_retracting", "never_moved")


class ByDirection(Model):
    """A straight line over velocity in each of five situations; a situation that never occurs gets 0 N.

    Without ``viscous`` friction, lines are level, at the median: of all constants the one with the smallest absolute
    error. With it, least squares on direction and velocity finds Coulomb and viscous friction, without Stribeck.
    """

    def __init__(self, inputs: Sequence[str], *, viscous: bool) -> None:
        super().__init__(inputs)
        self.viscous = viscous
        self.levels_n = np.zeros(len(SITUATIONS))  # Friction at vanishing velocity, in the order of ``SITUATIONS`` [N]
        self.viscous_n_s_m = 0.0  # Slope over velocity [N s/m]

    def fit(self, recordings: Sequence[Recording]) -> Self:
        friction_n, masks = labelled_rows(recordings)
        seen = [_situations(recording) for recording in recordings]
        situation = np.concatenate([each[mask] for (each, _), mask in zip(seen, masks, strict=True)])
        rows = [situation == number for number in range(len(SITUATIONS))]
        if not self.viscous:
            self.levels_n = np.array([np.median(friction_n[each]) if each.any() else 0.0 for each in rows])
            return self
        velocity = np.concatenate([each[mask] for (_, each), mask in zip(seen, masks, strict=True)])
        design = np.column_stack([*rows, velocity])
        found = np.linalg.lstsq(design.T @ design, design.T @ friction_n, rcond=None)[0]
        self.levels_n, self.viscous_n_s_m = found[:-1], float(found[-1])
        return self

    def estimate(self, recording: Recording) -> Array:
        situation, velocity = _situations(recording)
        return self.levels_n[situation] + self.viscous_n_s_m * velocity

    def multiply_adds(self) -> int:
        return AVERAGED + VELOCITY_WINDOW + 1


def _situations(recording: Recording) -> tuple[NDArray[np.int64], Array]:
    """Return each row's place in ``SITUATIONS`` and its velocity [m/s], shape ``(n,)`` each."""
    velocity, direction = steady_motion(recording.column("position_m"), recording.sample_time_s).T
    rest = np.select([direction > 0.0, direction < 0.0], [2, 3], default=4)
    return np.select([velocity > 0.0, velocity < 0.0], [0, 1], default=rest), velocity


def _balance(name: str, build: BuildConfiguration) -> FrictionEstimator:
    return baselines(build.cylinder, build.inputs)[name]


def _by_direction(viscous: bool, build: BuildConfiguration) -> ByDirection:
    return ByDirection(build.inputs, viscous=viscous)


MODELS = (
    RegisteredModel(
        name="low_pass",
        title="Force balance behind a tuned low-pass",
        family="baseline",
        source="equation of motion; Jelali and Kroll 2003",
        build=partial(_balance, "force_balance_low_pass"),
        supports=needs_raw_pressures,
        chosen="First order; its weight is the best for the task's own target. Fitted to a target that lies ahead it "
        "is the last value held, filtered as well as one weight can.",
    ),
    RegisteredModel(
        name="hold",
        title="Force balance of this sample, held",
        family="baseline",
        source="equation of motion; Jelali and Kroll 2003",
        build=partial(_balance, "force_balance_unfiltered"),
        supports=needs_raw_pressures,
        chosen="Unfiltered, without inertia; as a forecast it means that friction stays as it is.",
    ),
    RegisteredModel(
        name="constant_by_direction",
        title="One constant per direction",
        family="baseline",
        source="Coulomb friction",
        build=partial(_by_direction, False),
        chosen="The median friction while extending, while retracting, and at rest after either; a backlash of "
        "0.06 mm separates motion from noise.",
    ),
    RegisteredModel(
        name="coulomb_viscous_line",
        title="Coulomb and viscous friction, a straight line",
        family="baseline",
        source="Coulomb and viscous friction",
        build=partial(_by_direction, True),
        chosen="Least squares on direction and velocity; at rest the mean after either direction; no Stribeck.",
    ),
)
