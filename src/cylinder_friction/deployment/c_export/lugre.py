"""LuGre in C: velocity from position through the play, then the exact step of ``friction_models.lugre``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.c_export.block import EstimateBlock, StateField
from cylinder_friction.deployment.c_export.literals import filled, number
from cylinder_friction.estimators.base import NotFittedError
from cylinder_friction.friction_models.lugre import LUGRE_STEP_MULTIPLY_ADDS
from cylinder_friction.realtime.bounds import unknown_bounds, velocity_taps
from cylinder_friction.realtime.guard import guard_from
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps

if TYPE_CHECKING:
    from cylinder_friction.deployment.c_export.filters import FilterBank
    from cylinder_friction.deployment.c_export.literals import Type
    from cylinder_friction.estimators.lugre import LugreEstimator
    from cylinder_friction.friction_models.lugre import LugreParameters
    from cylinder_friction.signals.causal_velocity import CausalVelocity

POSITION = 2


@dataclass(frozen=True)
class LugreModel:
    """One LuGre estimator as plain numbers.

    Attributes:
        step: Filters (smooth position and rate as its two features), guard and bounds; no network, no forest.
        parameters: The model.
        sense: How velocity is made from position.
        pressure_scaled: Whether dry friction grows with the sum of both pressures.
    """

    step: StepModel
    parameters: LugreParameters
    sense: CausalVelocity
    pressure_scaled: bool


def lugre_model(estimator: LugreEstimator) -> LugreModel:
    """Return what one step of a fitted LuGre estimator needs; its bounds say nothing unless it was calibrated."""
    if estimator.sample_time_s is None or estimator.training_range is None:
        raise NotFittedError(f"{estimator.kind}: not fitted yet; call fit or load first")
    assert estimator.parameters is not None
    assert estimator.sense is not None
    time_s, sense = estimator.sample_time_s, estimator.sense
    taps = np.zeros((2, 3, sense.window))
    for derivative in (0, 1):
        taps[derivative, POSITION] = one_sided_savitzky_golay_taps(sense.window, sense.order, derivative, time_s)
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
    return LugreModel(step, estimator.parameters, sense, estimator.pressure_scaled)


def lugre_block(model: LugreModel, bank: FilterBank, real: Type) -> EstimateBlock:
    """Return the C of the play and of one step of the model."""
    smooth, rate = bank.feature
    law, sense = model.parameters, model.sense
    constants = {
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
        "time": model.step.sample_time_s,
        "play": sense.backlash_m,
        "dead_band": sense.dead_band_m_s,
    }
    gate = "1" if sense.backlash_m == 0.0 else f"state->pushed > 0u && rate * state->push > {number(0.0, real)}"
    values = {name: number(value, real) for name, value in constants.items()}
    values |= {name: name + ("f" if real == "float" else "") for name in ("exp", "expm1", "log", "fabs")}
    values |= {
        "name": "@name@",
        "lasting": f"{sense.window}u",
        "gate": gate,
        "smooth": f"filtered[{smooth}]",
        "rate": f"filtered[{rate}]",
    }
    source = _SOURCE
    for place, text in _PRESSURE.items():
        source = source.replace(place, text if model.pressure_scaled else "")
    code = filled(source, values)
    fields = (
        StateField("real", "play_centre_m", (), "centre of the play in the position"),
        StateField("real", "push", (), "-1, 0 or 1: direction of the last push against the play"),
        StateField("real", "bristle_m", (), "deflection of the bristles"),
        StateField("uint32_t", "pushed", (), "steps for which that push counts"),
    )
    begin = f"    if (first) {{\n        state->play_centre_m = filtered[{smooth}];\n    }}\n"
    return EstimateBlock(fields, begin, code, LUGRE_STEP_MULTIPLY_ADDS)


_PRESSURE = {
    "@pressure@": "    const real pressure = state->held[0] + state->held[1];\n",
    "@scaled@": "    dry *= R(1.0) + @slope@ * (pressure > R(0.0) ? pressure : R(0.0)) / @coulomb@;\n",
}
"""What dry friction that grows with both pressures adds."""

_SOURCE = """\
/* Velocity counts only while the smooth position has lately pushed against a play, in the direction of the push. */
static real gated_velocity(@name@_state *state, real position, real rate)
{
    if (position > state->play_centre_m + @play@) {
        state->play_centre_m = position - @play@;
        state->push = R(1.0);
        state->pushed = @lasting@;
    } else if (position < state->play_centre_m - @play@) {
        state->play_centre_m = position + @play@;
        state->push = R(-1.0);
        state->pushed = @lasting@;
    } else if (state->pushed > 0u) {
        --state->pushed;
    }
    return @fabs@(rate) >= @dead_band@ && (@gate@) ? rate : R(0.0);
}

/* LuGre (Canudas de Wit et al. 1995), solved exactly at a velocity that is held over the step. */
static real estimate(@name@_state *state, const real filtered[ROWS])
{
    const real velocity = gated_velocity(state, @smooth@, @rate@);
    const real speed = @fabs@(velocity);
@pressure@    const real ratio = velocity / @damping_velocity@;
    real dry, decay, after, rise;
    if (!(speed > R(0.0))) {
        return @stiffness@ * state->bristle_m;
    }
    dry = @coulomb@ + @falling@ * @exp@(-@exp@(@exponent@ * (@log@(speed) - @log_stribeck@)));
@scaled@    if (velocity < R(0.0)) {
        dry *= @retract@;
    }
    decay = @stiffness@ * speed * @time@ / dry;
    after = state->bristle_m * @exp@(-decay) - @expm1@(-decay) * (velocity / speed) * (dry / @stiffness@);
    rise = (after - state->bristle_m) / @time@;
    state->bristle_m = after;
    return @stiffness@ * after + @damping@ * @exp@(-(ratio * ratio)) * rise + @viscous@ * velocity;
}
"""
