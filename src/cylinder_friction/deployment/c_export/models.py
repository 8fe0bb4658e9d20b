"""A ``StepModel`` of every estimator that has one: learned ones, and those that are linear in lagged samples."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from cylinder_friction.estimators.base import NotFittedError
from cylinder_friction.estimators.forest_alone import ForestEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.realtime.bounds import unknown_bounds, velocity_taps
from cylinder_friction.realtime.from_hybrid import step_model
from cylinder_friction.realtime.guard import guard_from
from cylinder_friction.realtime.model import StepModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.estimators.base import FrictionEstimator

    Array = NDArray[np.float64]

Part = Literal["whole", "lstm", "base"]

FORGOTTEN = 1e-12
"""A response ends where all that follows weighs less than this share of its largest value."""
LONGEST_RESPONSE = 4096
IMPULSE = 2.0**20
"""Large beside what a linear estimator gives at rest, so that little is lost when that is taken off."""


def model_of(estimator: FrictionEstimator) -> StepModel:
    """Return what one step of an estimator needs.

    Raises:
        NotFittedError: There is nothing fitted or loaded yet.
        ValueError: The estimator is of a kind that has no such step.
    """
    if isinstance(estimator, HybridEstimator | ForestEstimator):
        return step_model(estimator)
    if isinstance(estimator, ForceBalanceEstimator | LowPassForceBalanceEstimator | RidgeEstimator):
        return linear_model(estimator)
    raise ValueError(f"{estimator.kind}: has no real-time step; expected a hybrid, forest, force balance or ridge")


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


def linear_model(estimator: FrictionEstimator) -> StepModel:
    """Return the step of an estimator that is linear in lagged raw samples, found from its response to impulses."""
    if estimator.sample_time_s is None or estimator.training_range is None:
        raise NotFittedError(f"{estimator.kind}: not fitted yet; call fit or load first")
    taps, at_rest_n = impulse_response(estimator)
    return StepModel(
        sample_time_s=estimator.sample_time_s,
        feature_taps=np.zeros((0, 3, 1)),
        feature_limits=np.zeros(0),
        feature_mean=np.zeros(0),
        feature_scale=np.ones(0),
        base_taps=taps,
        velocity_taps=velocity_taps(estimator.sample_time_s),
        network=None,
        forest=None,
        forest_sees="nothing",
        head_counts=False,
        target_mean_n=at_rest_n,
        target_scale_n=1.0,
        guard=estimator.guard or guard_from(estimator.training_range, math.inf, estimator.sample_time_s),
        bounds=estimator.bounds or unknown_bounds(estimator.sample_time_s),
    )


def impulse_response(estimator: FrictionEstimator) -> tuple[Array, float]:
    """Return the taps of a linear estimator, shape ``(3, lags)``, and what it gives for zeros [N].

    A filter without end (a low-pass) is cut where the rest no longer counts.
    """
    responses = np.empty((3, LONGEST_RESPONSE))
    at_rest_n = float(estimator.advance(estimator.new_state(), np.zeros((1, 3)))[0])
    for channel in range(3):
        state = estimator.new_state()
        estimator.advance(state, np.zeros((1, 3)))
        samples = np.zeros((LONGEST_RESPONSE, 3))
        samples[0, channel] = IMPULSE
        responses[channel] = (estimator.advance(state, samples) - at_rest_n) / IMPULSE
    counts = np.abs(responses) > FORGOTTEN * np.abs(responses).max(axis=1, keepdims=True)
    used = np.flatnonzero(counts.any(axis=0))
    length = int(used[-1]) + 1 if len(used) else 1
    return np.ascontiguousarray(np.where(counts, responses, 0.0)[:, :length]), at_rest_n
