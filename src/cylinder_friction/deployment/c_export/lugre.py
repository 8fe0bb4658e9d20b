"""LuGre in C: velocity from position through the backlash, then the exact step of ``friction_models.lugre``."""

import math
from dataclasses import dataclass

import numpy as np

from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.friction_models.lugre import LugreParameters
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.columns import POSITION
from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps
from cylinder_friction.signals.causal_velocity import CausalVelocity


@dataclass(frozen=True)
class LugreModel:
    """One LuGre estimator as plain numbers."""

    step: StepModel  # Filters (smooth position and rate as its two features), guard and bounds; no network, no forest
    parameters: LugreParameters  # The model
    velocity: CausalVelocity  # From position
    pressures: tuple[int, ...]  # Places among the inputs of the two whose sum scales dry friction; () for none


def lugre_model(estimator: LugreEstimator) -> LugreModel:
    """Return what one step of a fitted LuGre estimator needs; its bounds are as wide as can be unless calibrated."""
    estimator._refuse_unfitted()
    assert estimator.parameters is not None
    assert estimator.sample_time_s is not None
    assert estimator.causal_velocity is not None
    velocity, inputs = estimator.causal_velocity, estimator.inputs
    taps = np.zeros((2, len(inputs), velocity.window))
    for derivative in (0, 1):
        taps[derivative, inputs.index(POSITION)] = one_sided_savitzky_golay_taps(
            velocity.window, velocity.order, derivative, estimator.sample_time_s
        )
    step = estimator._step_model(
        feature_taps=taps,
        feature_limits=np.zeros(2),
        feature_mean=np.zeros(2),
        feature_scale=np.ones(2),
        base_taps=np.zeros((len(inputs), 1)),
    )
    return LugreModel(step, estimator.parameters, velocity, estimator._pressures or ())


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
        "pressures": model.pressures,
    }
