"""Strata: where in the motion a row lies."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.evaluation.strata import STRATA, StrataLimits, strata_masks

LIMITS = StrataLimits(standstill_velocity_m_s=0.001, near_zero_velocity_m_s=0.016, reversal_window_s=0.02)


def test_each_row_of_a_stroke_out_and_back():
    velocity = np.array([0.0, 0.005, 0.05, 0.05, 0.0, 0.0, -0.005, -0.05, -0.05, -0.05, -0.05])
    masks = strata_masks(velocity, 0.005, LIMITS)
    assert list(masks) == list(STRATA)
    assert np.flatnonzero(masks["standstill"]).tolist() == [0, 4, 5]
    assert np.flatnonzero(masks["near_zero"]).tolist() == [1, 6]
    assert np.flatnonzero(masks["sliding"]).tolist() == [2, 3, 7, 8, 9, 10]
    assert np.flatnonzero(masks["extend"]).tolist() == [1, 2, 3]
    assert np.flatnonzero(masks["retract"]).tolist() == [6, 7, 8, 9, 10]
    assert np.flatnonzero(masks["after_reversal"]).tolist() == [6, 7, 8, 9]


def test_a_stop_without_change_of_direction_is_no_reversal():
    velocity = np.array([0.05, 0.0, 0.0, 0.05, 0.05])
    assert not strata_masks(velocity, 0.005, LIMITS)["after_reversal"].any()


@given(st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=60))
def test_rest_near_zero_and_sliding_split_all_rows_and_directions_split_motion(values):
    masks = strata_masks(np.array(values), 0.005, LIMITS)
    split = np.stack([masks[name] for name in ("standstill", "near_zero", "sliding")])
    assert (split.sum(axis=0) == 1).all()
    assert ((masks["extend"] | masks["retract"]) == ~masks["standstill"]).all()
    assert not (masks["extend"] & masks["retract"]).any()
