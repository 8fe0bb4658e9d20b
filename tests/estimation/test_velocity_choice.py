"""Intervals of parameters hold what zeros of the sensors may shift."""

import numpy as np
import pytest

from cylinder_friction.estimation.velocity_choice import shifted_intervals
from cylinder_friction.friction_models.identification.procedure import Identification
from cylinder_friction.friction_models.lugre import LugreParameters
from cylinder_friction.friction_models.stribeck import StribeckCurve


def test_zeros_shift_dry_friction_and_its_ratio() -> None:
    curve = StribeckCurve(200.0, 260.0, 0.01, 1.0, 900.0)
    parameters = LugreParameters(
        coulomb_n=200.0,
        static_n=260.0,
        stribeck_velocity_m_s=0.01,
        stribeck_exponent=1.0,
        viscous_n_s_m=900.0,
        bristle_stiffness_n_m=1e6,
        bristle_damping_n_s_m=100.0,
        damping_velocity_m_s=0.01,
        retract_ratio=1.2,
    )
    intervals = {"coulomb_n": (197.0, 204.0), "viscous_n_s_m": (850.0, 950.0), "retract_ratio": (1.2, 1.2)}
    found = Identification(parameters, "a", intervals, (), curve, 5.0, 250.0, 6.0, (), 9)
    assert shifted_intervals(found, intervals, 0.0) == intervals
    wide = shifted_intervals(found, intervals, 40.0)
    assert wide["coulomb_n"] == pytest.approx((200.0 - np.hypot(3.0, 40.0), 200.0 + np.hypot(4.0, 40.0)))
    assert wide["viscous_n_s_m"] == intervals["viscous_n_s_m"]
    assert wide["retract_ratio"] == pytest.approx((1.2 - 0.3872, 1.2 + 0.3872))
    assert shifted_intervals(found, intervals, 900.0)["coulomb_n"][0] > 0.0
