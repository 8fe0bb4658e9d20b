"""LuGre in C: velocity from position through the backlash, then the exact step of ``friction_models.lugre``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.base import NotFittedError
from cylinder_friction.realtime.bounds import unknown_bounds, velocity_taps
from cylinder_friction.realtime.guard import guard_from
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps

if TYPE_CHECKING:
    from cylinder_friction.estimators.lugre import LugreEstimator
    from cylinder_friction.friction_models.lugre import LugreParameters
    from cylinder_friction.signals.causal_velocity import CausalVelocity

POSITION = 2


@dataclass(frozen=True)
class LugreModel:
    """One LuGre estimator as plain numbers."""

    step: StepModel  # Filters (smooth position and rate as its two features), guard and bounds; no network, no forest
    parameters: LugreParameters  # The model
    velocity: CausalVelocity  # From position
    pressure_scaled: bool  # Whether dry friction grows with the sum of both pressures


def lugre_model(estimator: LugreEstimator) -> LugreModel:
    """Return what one step of a fitted LuGre estimator needs; its bounds are as wide as can be unless calibrated."""
    if estimator.sample_time_s is None or estimator.training_range is None:
        raise NotFittedError(f"{estimator.kind}: not fitted yet; call fit or load first")
    assert estimator.parameters is not None
    assert estimator.causal_velocity is not None
    time_s, velocity = estimator.sample_time_s, estimator.causal_velocity
    taps = np.zeros((2, 3, velocity.window))
    for derivative in (0, 1):
        taps[derivative, POSITION] = one_sided_savitzky_golay_taps(velocity.window, velocity.order, derivative, time_s)
    step = StepModel(
        sample_time_s=time_s,
        feature_taps=taps,
        feature_limits=np.zeros(2),
        feature_mean=np.zeros(2),
        feature_scale=np.ones(2),
        base_taps=np.zeros((3, 1)),
        velocity_taps=velocity_taps(time_s),
        network=None,
        forest=None,
        forest_sees="nothing",
        head_counts=False,
        target_mean_n=0.0,
        target_scale_n=1.0,
        guard=estimator.guard or guard_from(estimator.training_range, math.inf, time_s),
        bounds=estimator.bounds or unknown_bounds(time_s),
    )
    return LugreModel(step, estimator.parameters, velocity, estimator.pressure_scaled)


def lugre_values(model: LugreModel) -> dict[str, object]:
    """Return the values of LuGre's template."""
    law, motion = model.parameters, model.velocity
    return {
        "coulomb": law.coulomb_n,
        "falling": law.static_n - law.coulomb_n,
        "log_stribeck": math.log(law.stribeck_velocity_m_s),
        "exponent": law.stribeck_exponent,
        "viscous": law.viscous_n_s_m,
        "stiffness": law.bristle_stiffness_n_m,
        "damping": law.bristle_damping_n_s_m,
        "damping_velocity": law.damping_velocity_m_s,
        "retract": law.retract_ratio,
        "slope": law.pressure_slope_n_pa,
        "backlash": motion.backlash_m,
        "dead_band": motion.dead_band_m_s,
        "window": motion.window,
        "pressures": (0, 1) if model.pressure_scaled else (),
    }
