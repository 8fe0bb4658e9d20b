"""Every model keeps the contract of estimators, on several sets of sensors."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.testing.estimator_contract import CHECKS, Case
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from collections.abc import Callable

    from cylinder_friction.cylinder import Cylinder
    from friction_benchmark.registry.model import RegisteredModel

EFFORT = 0.01
ROWS = 800
INPUTS = {
    "raw": SAMPLE_COLUMNS,
    "raw_and_temperature": (*SAMPLE_COLUMNS, "oil_temperature_c"),
    "levels": ("position_m", "oil_temperature_c", "pressure_1_level_pa", "pressure_2_level_pa"),
}


def built(model: RegisteredModel, inputs: tuple[str, ...], cylinder: Cylinder) -> FrictionEstimator:
    return model.build(BuildConfiguration(cylinder, inputs, 0, EFFORT, model.defaults))


MAKERS: dict[str, Callable[[Cylinder], FrictionEstimator]] = {
    f"{model.name}-{name}": partial(built, model, inputs)
    for model in registered_models().values()
    for name, inputs in INPUTS.items()
    if model.supports(inputs) and not (name == "raw" and model.supports(INPUTS["raw_and_temperature"]))
}


@pytest.fixture(scope="module")
def recordings(labelled_recordings: list[Recording]) -> list[Recording]:
    """The first seconds of each, with an oil temperature and pressures that vary slowly."""
    made = []
    for number, whole in enumerate(labelled_recordings):
        recording = Recording(whole.metadata, whole.table.iloc[:ROWS].reset_index(drop=True))
        levels = {
            f"pressure_{side}_level_pa": np.full(ROWS, recording.column(f"pressure_{side}_pa").mean())
            for side in (1, 2)
        }
        made.append(recording.with_columns(oil_temperature_c=np.linspace(30.0, 35.0, ROWS) + number, **levels))
    return made


@pytest.fixture(scope="module", params=sorted(MAKERS))
def case(request: pytest.FixtureRequest, cylinder: Cylinder, recordings: list[Recording]) -> Case:
    return Case(partial(MAKERS[request.param], cylinder), recordings)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_it_keeps(check: Callable[[Case], None], case: Case) -> None:
    check(case)


def test_friction_is_of_the_right_size(case: Case) -> None:
    error_n = np.abs(case.estimate - case.recording.column("friction_n")).mean()
    assert error_n < 1.1 * np.abs(case.recording.column("friction_n")).mean()


def test_no_model_is_forgotten(cylinder: Cylinder) -> None:
    models = {kind for kind in FrictionEstimator._kinds.values() if kind.__module__.startswith("friction_benchmark.")}
    assert models - {type(make(cylinder)) for make in MAKERS.values()} == set()
