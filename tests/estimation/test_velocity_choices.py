"""Off-line velocities follow strokes and rest."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.estimation.steady_intervals import velocities_on_offer
from cylinder_friction.recordings.recording import Recording, RecordingMetadata

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
