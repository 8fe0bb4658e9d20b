"""The registry: names, what can be built for which inputs, and that both ends of each space can be."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.registry import (
    baselines,
    disturbance_observer,
    gradient_boosting,
    learned_gain,
    lugre_residual,
    narx,
    ridge,
)
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.registry.model import BuildConfiguration, OneOf, Range

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.registry.model import RegisteredModel

FAMILIES = (baselines, ridge, narx, gradient_boosting, lugre_residual, disturbance_observer, learned_gain)
MODELS = {entry.name: entry for family in FAMILIES for entry in family.MODELS}
EFFORT = 0.02


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("inputs", [SAMPLE_COLUMNS, ("position_m",)], ids=["raw", "blind"])
def test_each_can_be_built_and_fitted_where_it_is_supported(
    name: str, inputs: tuple[str, ...], cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    entry = MODELS[name]
    if not entry.supports(inputs):
        assert inputs == ("position_m",)
        assert name in ("low_pass", "hold", "disturbance_observer", "learned_gain", "twin_hybrid")
        return
    estimator = entry.build(BuildConfiguration(cylinder, inputs, 0, EFFORT, entry.defaults))
    assert set(estimator.inputs) <= set(inputs)
    estimator.fit(labelled_recordings)
    assert np.isfinite(estimator.estimate(labelled_recordings[0])).all()


def corners(entry: RegisteredModel, high: bool) -> dict[str, float | int | str]:
    found: dict[str, float | int | str] = {}
    for name, allowed in entry.space.items():
        if isinstance(allowed, Range):
            found[name] = allowed.high if high else allowed.low
        elif isinstance(allowed, OneOf):
            found[name] = allowed.values[-1 if high else 0]
    return found


@pytest.mark.parametrize("high", [False, True])
@pytest.mark.parametrize("name", [name for name, entry in registered_models().items() if entry.space])
def test_both_ends_of_what_may_be_tuned_can_be_built(name: str, high: bool, cylinder: Cylinder) -> None:
    entry = registered_models()[name]
    entry.build(BuildConfiguration(cylinder, SAMPLE_COLUMNS, 0, EFFORT, corners(entry, high)))


def test_more_effort_means_more_trees(cylinder: Cylinder) -> None:
    entry = MODELS["gradient_boosting"]
    quick, full = (
        entry.build(BuildConfiguration(cylinder, SAMPLE_COLUMNS, 0, effort, entry.defaults)) for effort in (0.25, 1.0)
    )
    assert (quick.plan.trees, full.plan.trees) == (100, 400)  # type: ignore[attr-defined]


def test_every_model_can_be_sent_to_a_worker_and_names_its_module() -> None:
    for model in registered_models().values():
        assert pickle.loads(pickle.dumps(model)).name == model.name
        assert model.module.startswith("friction_benchmark.registry.")


def test_two_models_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match=r"two models are called 'ridge'; the second is in friction"):
        registered_models(["friction_benchmark.registry.ridge"] * 2)


def test_a_default_for_every_tuned_name_is_required() -> None:
    with pytest.raises(ValueError, match=r"ridge: space has \['lags', 'penalty'\], but defaults have \['lags'\]"):
        replace(MODELS["ridge"], defaults={"lags": 3})
