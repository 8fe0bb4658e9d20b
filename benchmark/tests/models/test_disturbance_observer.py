"""The observer separates friction from sensor errors, and adapts to clean sensors."""

from __future__ import annotations

from dataclasses import astuple
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.disturbance_observer import (
    COEFFICIENTS,
    DisturbanceObserver,
    ObserverNoise,
    first_covariance,
    law_parts,
    observe,
    sensor_errors,
    sliding_law,
)
from friction_benchmark.registry import BuildConfiguration

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.registry import Estimator

STEP_S = 0.005
AREAS = np.array([3.117e-3, 2.501e-3])


def with_sensor_errors(recordings: list[Recording], seed: int) -> list[Recording]:
    """Offsets within ±1.25 bar and drifts within ±0.01 bar/s on both pressures, others for each recording."""
    generator = np.random.default_rng(seed)
    made = []
    for recording in recordings:
        columns = {
            name: recording.column(name)
            + 1e5 * (generator.uniform(-1.25, 1.25) + generator.uniform(-0.01, 0.01) * recording.column("time_s"))
            for name in ("pressure_1_pa", "pressure_2_pa")
        }
        made.append(recording.with_columns(**columns))
    return made


def observer(cylinder: Cylinder) -> DisturbanceObserver:
    return DisturbanceObserver(BuildConfiguration(cylinder, SAMPLE_COLUMNS, 0, 0.05, {}))


def mae_n(estimator: Estimator, recordings: list[Recording]) -> float:
    return float(np.mean([np.abs(estimator.estimate(r) - r.column("friction_n")).mean() for r in recordings]))


def test_with_wrong_sensors_it_leaves_a_small_part_of_the_low_pass_error(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    train, unseen = with_sensor_errors(labelled_recordings, 0), with_sensor_errors(labelled_recordings, 1)
    drifting, baseline = observer(cylinder).fit(train), LowPassForceBalanceEstimator(cylinder).fit(train)
    assert mae_n(drifting, unseen) < 0.25 * mae_n(baseline, unseen)
    # Uniform within ±1.25 bar on both areas: 1.25 bar / sqrt(3) times the root of the sum of squared areas, 288 N.
    assert 120.0 < drifting.noise.bias_n < 450.0
    assert 0.5 < drifting.noise.bias_rate_n_s < 8.0


def test_with_right_sensors_it_is_no_worse_than_the_low_pass(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    fitted, baseline = observer(cylinder), LowPassForceBalanceEstimator(cylinder)
    fitted.fit(labelled_recordings)
    baseline.fit(labelled_recordings)
    assert fitted.noise.bias_n < 10.0
    assert mae_n(fitted, labelled_recordings) < mae_n(baseline, labelled_recordings)


def test_sensor_errors_of_a_known_ramp() -> None:
    time_s, mask = STEP_S * np.arange(4000), np.ones(4000, dtype=bool)
    found = sensor_errors([(100.0 + 3.0 * time_s, mask), (-100.0 - 3.0 * time_s, mask)], STEP_S)
    assert found["bias_n"] == pytest.approx(100.0, rel=0.02)
    assert found["bias_rate_n_s"] == pytest.approx(3.0, rel=0.02)
    assert found["bias_walk_n"] == pytest.approx(0.01)
    assert sensor_errors([(np.ones(10), np.zeros(10, dtype=bool))], STEP_S) == {}


def observed(
    motion: np.ndarray, balance_n: np.ndarray, law: np.ndarray, noise: ObserverNoise
) -> tuple[np.ndarray, ...]:
    covariance = first_covariance(noise, AREAS)
    bars = np.full(len(motion), 30.0)
    found = observe(motion, balance_n, bars, law, np.array(astuple(noise)), AREAS, STEP_S, covariance)
    return found, covariance


def test_an_hour_leaves_the_covariance_symmetric_and_positive_definite() -> None:
    generator = np.random.default_rng(0)
    law, rows = np.zeros((2, COEFFICIENTS)), 720_000
    law[:, 0], law[:, 6] = 240.0, 4.0
    velocity = np.where(np.arange(rows) // 6000 % 3 > 0, 0.02 * np.cos(0.004 * np.arange(rows)), 0.0)
    motion = np.column_stack([velocity, np.zeros(rows), np.sign(velocity), np.exp(-np.abs(velocity) / 0.012)])
    noisy = generator.normal(0.0, np.where(np.arange(rows) // 6000 % 5 > 0, 10.0, 3e3))
    found, covariance = observed(
        motion, 300.0 * motion[:, 2] + 200.0 + noisy, law, ObserverNoise(bias_n=288.0, bias_rate_n_s=3.0)
    )
    assert np.isfinite(found).all()
    np.testing.assert_array_equal(covariance, covariance.T)
    np.linalg.cholesky(covariance)


def test_one_correction_is_the_textbook_one() -> None:
    """At rest and within the gate, one row equals predict and correct with plain matrices."""
    noise = ObserverNoise(bias_n=50.0, gate=1e3)
    kept = np.array([1, 1, 1, 1, 1, np.exp(-STEP_S / noise.slow_s), np.exp(-STEP_S / noise.rest_s)])
    transition = np.diag(kept)
    transition[0, 2] = transition[1, 3] = STEP_S
    share = AREAS**2 / (AREAS**2).sum()
    process = np.diag(
        [
            *(share * STEP_S * noise.bias_walk_n**2),
            *(1e-4 * share * STEP_S * noise.bias_rate_n_s**2),
            1e-3 * STEP_S * noise.scale**2,
            (1 - kept[5] ** 2) * noise.slow_n**2,
            (1 - kept[6] ** 2) * noise.rest_n**2,
        ]
    )
    predicted = transition @ first_covariance(noise, AREAS) @ transition.T + process
    row = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0])
    gain = predicted @ row / (row @ predicted @ row + noise.balance_n**2)
    found, covariance = observed(np.zeros((1, 4)), np.array([80.0]), np.zeros((2, COEFFICIENTS)), noise)
    missed = np.eye(7) - np.outer(gain, row)
    expected = missed @ predicted @ missed.T + noise.balance_n**2 * np.outer(gain, gain)
    np.testing.assert_allclose(covariance, expected, rtol=1e-9, atol=1e-9)
    assert found[0] == pytest.approx(80.0 * (gain[5] + gain[6]))


def test_the_law_finds_coulomb_viscous_and_pressure_parts() -> None:
    generator = np.random.default_rng(0)
    count = 20_000
    speed, pressure = generator.uniform(1e-3, 0.1, count), generator.uniform(5.0, 80.0, count)
    direction = generator.choice([-1.0, 1.0], count)
    friction = direction * (240.0 + 3.0 * pressure + 1500.0 * speed + 120.0 * np.exp(-speed / 0.012))
    friction[::50] += 5e3  # outliers
    motion = np.column_stack([direction * speed, np.zeros(count), direction, np.exp(-speed / 0.012)])
    law = sliding_law(motion, pressure, friction)
    for side in (1.0, -1.0):
        plain, slope = law_parts(law, side, 0.05, np.exp(-0.05 / 0.012))
        assert side * (plain + 40.0 * slope) == pytest.approx(240.0 + 120.0 + 75.0 + 1.86, abs=3.0)
        assert side * slope == pytest.approx(3.0, abs=0.1)
    assert law_parts(law, 0.0, 0.0, 1.0) == (0.0, 0.0)
