"""A ``StepModel`` of every estimator that has one: learned ones, and those that are linear in lagged samples."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from cylinder_friction.realtime.bounds import unknown_bounds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import StepModel

    Array = NDArray[np.float64]

Part = Literal["whole", "lstm", "base"]


def model_of(estimator: FrictionEstimator) -> StepModel:
    """Return what one step of an estimator needs.

    Raises:
        NotFittedError: There is nothing fitted or loaded yet.
        ValueError: The estimator is of a kind that has no such step.
    """
    return estimator.step_model()


def part_of(model: StepModel, part: Part) -> StepModel:
    """Return a smaller model inside a hybrid: ``lstm`` leaves the forest out, ``base`` the network too.

    Its bounds say nothing, since they were calibrated on the whole.

    Raises:
        ValueError: The model has no such part.
    """
    if part not in get_args(Part):
        raise ValueError(f"part must be one of {', '.join(get_args(Part))}, but got {part!r}")
    if part == "whole":
        return model
    if part == "lstm" and model.network is None:
        raise ValueError("the model has no LSTM; expected a hybrid")
    if part == "base" and not np.any(model.base_taps):
        raise ValueError("the model corrects no force balance, so nothing is left without network and forest")
    network = model.network if part == "lstm" else None
    return replace(
        model,
        network=network,
        forest=None,
        forest_sees="nothing",
        head_counts=network is not None,
        bounds=unknown_bounds(model.sample_time_s),
    )
