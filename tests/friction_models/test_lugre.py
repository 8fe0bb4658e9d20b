from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from friction_samples import PLAIN_LUGRE as PLAIN
from friction_samples import new_bristle, simulate


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31))
def test_a_passive_model_gives_back_no_more_than_its_bristles_hold(seed: int) -> None:
    generator = np.random.default_rng(seed)
    step = 1e-5
    velocity = np.repeat(generator.normal(0.0, 0.02, 20), 500)
    bristle = new_bristle()
    friction = simulate(PLAIN, velocity, step, bristle)
    assert PLAIN.is_passive()
    stored = 0.5 * PLAIN.bristle_stiffness_n_m * bristle[0] ** 2
    put_in = float(np.sum(friction * velocity) * step)
    assert put_in >= stored * (1.0 - 1e-3) - 1e-6


def test_passivity_is_lost_when_damping_reaches_too_far() -> None:
    limit = PLAIN.passive_damping_velocity_m_s
    assert limit == pytest.approx(4.0 * np.sqrt(2.0 * np.e) * 240.0 / 4000.0)
    assert not replace(PLAIN, damping_velocity_m_s=1.01 * limit).is_passive()
    assert replace(PLAIN, bristle_damping_n_s_m=0.0, damping_velocity_m_s=1e3).is_passive()


def test_impossible_parameters_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"bristle_stiffness_n_m must be a positive number, but got 0\.0"):
        replace(PLAIN, bristle_stiffness_n_m=0.0)
    with pytest.raises(ValueError, match=r"pressure_slope_n_pa must be zero or a positive number, but got -1\.0"):
        replace(PLAIN, pressure_slope_n_pa=-1.0)
