"""A trained estimator as a ``StepModel``: plain arrays, from which every runtime is built."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator, NotFittedError
from cylinder_friction.estimators.onnx_files import network_from_onnx
from cylinder_friction.realtime.bounds import unknown_bounds, velocity_taps
from cylinder_friction.realtime.forest import forest_from_onnx
from cylinder_friction.realtime.guard import guard_from
from cylinder_friction.realtime.model import Bounds, Guard, StepModel

if TYPE_CHECKING:
    from cylinder_friction.estimators.forest_alone import ForestEstimator
    from cylinder_friction.estimators.hybrid import HybridEstimator


def step_model(estimator: FrictionEstimator, guard: Guard | None = None, bounds: Bounds | None = None) -> StepModel:
    """Return what one step of ``estimator`` needs.

    Args:
        estimator: Fitted: a hybrid of either design, with or without its forest, or a forest without a network.
        guard: In place of the estimator's own; without either, one from its training range, which cannot notice a
            frozen position.
        bounds: In place of the estimator's own; without either, bounds so wide that they say nothing.

    Raises:
        NotFittedError: There is nothing fitted or loaded yet.
        ValueError: It is an estimator of another kind, which no real-time step is made for.
    """
    if estimator.kind not in ("hybrid", "random_forest"):
        raise ValueError(f"expected an estimator of kind 'hybrid' or 'random_forest', but got {estimator.kind!r}")
    if estimator.sample_time_s is None or estimator.training_range is None:
        raise NotFittedError(f"{estimator.kind}: not fitted yet; call fit or load first")
    sample_time_s = estimator.sample_time_s
    guard = guard or estimator.guard or guard_from(estimator.training_range, np.inf, sample_time_s)
    bounds = bounds or estimator.bounds or unknown_bounds(sample_time_s)
    if estimator.kind == "random_forest":
        return _of_forest(cast("ForestEstimator", estimator), sample_time_s, guard, bounds)
    return _of_hybrid(cast("HybridEstimator", estimator), sample_time_s, guard, bounds)


def _of_hybrid(estimator: HybridEstimator, sample_time_s: float, guard: Guard, bounds: Bounds) -> StepModel:
    parts = estimator.parts
    assert parts is not None
    front_end = parts.front_end
    paper = parts.design == "paper"
    forest = None if parts.forest is None else forest_from_onnx(parts.forest)
    return StepModel(
        sample_time_s=sample_time_s,
        feature_taps=np.ascontiguousarray(front_end.taps, dtype=np.float64),
        feature_limits=front_end.limits,
        feature_mean=front_end.mean,
        feature_scale=front_end.scale,
        base_taps=np.zeros((3, 1)) if front_end.base_taps is None else np.ascontiguousarray(front_end.base_taps[0]),
        velocity_taps=velocity_taps(sample_time_s),
        network=network_from_onnx(parts.network),
        forest=forest,
        forest_sees="nothing" if forest is None else "hidden" if paper else "hidden_head_features",
        head_counts=forest is None or not paper,
        target_mean_n=parts.target_mean_n,
        target_scale_n=parts.target_scale_n,
        guard=guard,
        bounds=bounds,
    )


def _of_forest(estimator: ForestEstimator, sample_time_s: float, guard: Guard, bounds: Bounds) -> StepModel:
    front_end = estimator.front_end_block.front_end
    return StepModel(
        sample_time_s=sample_time_s,
        feature_taps=np.ascontiguousarray(front_end.taps, dtype=np.float64),
        feature_limits=front_end.limits,
        feature_mean=front_end.mean,
        feature_scale=front_end.scale,
        base_taps=np.zeros((3, 1)),
        velocity_taps=velocity_taps(sample_time_s),
        network=None,
        forest=estimator.forest,
        forest_sees="features",
        head_counts=False,
        target_mean_n=0.0,
        target_scale_n=1.0,
        guard=guard,
        bounds=bounds,
    )
