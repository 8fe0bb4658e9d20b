"""Models that need not long to fit estimate friction far better than zero does, from the position alone."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from friction_benchmark.models.disturbance_observer import DisturbanceObserver
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

POSITION = ("position_m",)
RELATED_WORK = {"machado": 0.25, "pan_elman": 0.25, "elman_adam": 0.25, "han_zero_shot": 0.4, "han_fine_tuned": 0.25}
"""Largest error on the position alone, at one load, as a share of mean friction."""
OTHERS = {"narx": 0.6, "gradient_boosting": 0.6, "lugre_residual": 0.6, "constant_by_direction": 0.6, "ridge": 1.0}
"""The same at four loads."""


def fitted(
    name: str, cylinder: Cylinder, recordings: list[Recording], effort: float, seed: int = 0
) -> FrictionEstimator:
    model = registered_models()[name]
    return model.build(BuildConfiguration(cylinder, POSITION, seed, effort, model.defaults)).fit(recordings)


def relative_error(estimator: FrictionEstimator, recordings: list[Recording]) -> float:
    errors = [np.abs(estimator.estimate(one) - one.column("friction_n")).mean() for one in recordings]
    return float(np.mean(errors) / np.mean([np.abs(one.column("friction_n")).mean() for one in recordings]))


@pytest.mark.parametrize("name", sorted(RELATED_WORK))
def test_velocity_explains_most_of_friction_at_one_load(
    name: str, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    one_load = labelled_recordings[:2]
    assert relative_error(fitted(name, cylinder, one_load, 0.05), one_load) < RELATED_WORK[name]


@pytest.mark.parametrize("name", sorted(OTHERS))
def test_velocity_explains_much_of_friction_at_many_loads(
    name: str, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    assert relative_error(fitted(name, cylinder, labelled_recordings, 0.02), labelled_recordings) < OTHERS[name]


@pytest.mark.parametrize("name", sorted(RELATED_WORK))
def test_another_seed_gives_another_network(
    name: str, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    one, other = (fitted(name, cylinder, labelled_recordings[:2], 0.003, seed) for seed in (3, 4))
    assert not np.array_equal(one.estimate(labelled_recordings[0]), other.estimate(labelled_recordings[0]))


def test_what_needs_raw_pressures_refuses_other_inputs(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match="expected pressure_1_pa, pressure_2_pa, position_m among the inputs, but got"):
        DisturbanceObserver(cylinder, POSITION)


def test_importing_the_networks_imports_no_torch() -> None:
    code = "import sys; from friction_benchmark.registry import elman, han, machado; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
