"""Off-line velocities follow strokes and rest; intervals of parameters hold what zeros may shift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.estimation.velocity_choices import shifted_intervals, velocities_on_offer
from cylinder_friction.friction_models.identification.procedure import Identification
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from friction_samples import PLAIN_LUGRE

SAMPLE_TIME_S, NOISE_M = 0.005, 3e-5


def recording(position_m: np.ndarray) -> Recording:
    time_s = SAMPLE_TIME_S * np.arange(len(position_m))
    table = pd.DataFrame({"time_s": time_s, "position_m": position_m, "drive_force_n": 0.0 * time_s})
    return Recording(RecordingMetadata("r", "1", "s", SAMPLE_TIME_S), table)


def test_every_candidate_is_zero_at_standstill_and_follows_a_stroke() -> None:
    true = np.concatenate([np.zeros(1000), np.full(400, 0.05), np.zeros(1000)])
    noise = np.random.default_rng(1).normal(0.0, NOISE_M, len(true))
    measured = recording(0.1 + np.cumsum(true) * SAMPLE_TIME_S + noise)
    offered = velocities_on_offer(NOISE_M, SAMPLE_TIME_S)
    assert len(offered) == 8
    for words, velocity in offered.items():
        found = velocity(measured)
        assert np.mean(found[100:900] == 0.0) > 0.98, words
        assert found[1100:1300].mean() == pytest.approx(0.05, rel=0.01), words


def test_zeros_shift_dry_friction_and_its_ratio() -> None:
    curve = StribeckCurve(200.0, 260.0, 0.01, 1.0, 900.0)
    parameters = replace(PLAIN_LUGRE, coulomb_n=200.0, viscous_n_s_m=900.0, retract_ratio=1.2)
    intervals = {"coulomb_n": (197.0, 204.0), "viscous_n_s_m": (850.0, 950.0), "retract_ratio": (1.2, 1.2)}
    found = Identification(parameters, "a", intervals, (), curve, 5.0, 250.0, ())
    assert shifted_intervals(found, intervals, 0.0) == intervals
    wide = shifted_intervals(found, intervals, 40.0)
    assert wide["coulomb_n"] == pytest.approx((200.0 - np.hypot(3.0, 40.0), 200.0 + np.hypot(4.0, 40.0)))
    assert wide["viscous_n_s_m"] == intervals["viscous_n_s_m"]
    assert wide["retract_ratio"] == pytest.approx((1.2 - 0.3872, 1.2 + 0.3872))
    assert shifted_intervals(found, intervals, 900.0)["coulomb_n"][0] > 0.0
