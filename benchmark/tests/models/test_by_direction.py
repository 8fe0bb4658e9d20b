"""Friction from the direction of the last motion, against levels that are known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from friction_benchmark.models.by_direction import (
    SITUATIONS,
    ConstantByDirectionEstimator,
    CoulombViscousLineEstimator,
)

SPEED_M_S = 0.02


def stroke_recording(viscous_n_s_m: float = 0.0) -> Recording:
    """Rest 1 s, out 2 s, rest 2 s, in 2 s at twice the speed, rest 2 s; friction +300, +100, -250 and -60 N."""
    generator = np.random.default_rng(0)
    speeds = np.repeat([0.0, SPEED_M_S, 0.0, -2.0 * SPEED_M_S, 0.0], [200, 400, 400, 400, 400])
    levels = np.repeat([7.0, 300.0, 100.0, -250.0, -60.0], [200, 400, 400, 400, 400])
    position_m = 0.1 + np.cumsum(speeds) * 0.005 + generator.normal(0.0, 3e-5, len(speeds))
    table = pd.DataFrame(
        {
            "time_s": 0.005 * np.arange(len(speeds)),
            "pressure_1_pa": 0.0,
            "pressure_2_pa": 0.0,
            "position_m": position_m,
            "friction_n": levels + viscous_n_s_m * speeds,
        }
    )
    return Recording(RecordingMetadata("strokes", "1", "s", 0.005), table)


def test_constants_are_the_medians_of_each_situation() -> None:
    estimator = ConstantByDirectionEstimator(("position_m",))
    estimator.fit([stroke_recording()])
    assert dict(zip(SITUATIONS, estimator.levels_n, strict=True)) == pytest.approx(
        {
            "extending": 300.0,
            "retracting": -250.0,
            "at_rest_after_extending": 100.0,
            "at_rest_after_retracting": -60.0,
            "never_moved": 7.0,
        }
    )


def test_the_line_finds_coulomb_and_viscous_friction() -> None:
    recording = stroke_recording(viscous_n_s_m=1500.0)
    estimator = CoulombViscousLineEstimator(("position_m",))
    settled = np.ones(len(recording), dtype=bool)
    for change in (200, 600, 1000, 1400):
        settled[change - 30 : change + 120] = False
    estimator.fit([recording.with_columns(usable=settled)])
    # One speed a direction leaves level and slope apart by both directions together alone: check the fitted line.
    extending = estimator.levels_n[0] + SPEED_M_S * estimator.viscous_n_s_m
    retracting = estimator.levels_n[1] - 2.0 * SPEED_M_S * estimator.viscous_n_s_m
    assert extending == pytest.approx(330.0, abs=3.0)
    assert retracting == pytest.approx(-310.0, abs=3.0)


def test_noise_at_standstill_does_not_turn_the_direction() -> None:
    estimator = ConstantByDirectionEstimator(("position_m",))
    estimator.fit([stroke_recording()])
    at_rest = estimator.estimate(stroke_recording())[760:1000]
    assert set(at_rest) == {100.0}


def test_a_situation_that_never_occurs_keeps_zero() -> None:
    recording = stroke_recording()
    still = Recording(recording.metadata, recording.table.iloc[:150].reset_index(drop=True))
    for estimator in (ConstantByDirectionEstimator(), CoulombViscousLineEstimator()):
        estimator.fit([still])
        np.testing.assert_allclose(estimator.levels_n, [0.0, 0.0, 0.0, 0.0, 7.0], atol=1e-9)


def test_position_must_be_among_the_inputs() -> None:
    with pytest.raises(ValueError, match="expected position_m among the inputs, but got"):
        ConstantByDirectionEstimator(("pressure_1_pa",))
