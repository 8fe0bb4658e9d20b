"""The observer: it tells friction from sensor errors, stays positive definite, and adapts to clean sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.signals.causal import FirFilter, moving_average_taps
from cylinder_friction.signals.kalman import constant_jerk
from friction_benchmark.models.disturbance_observer import (
    BIAS_1,
    COEFFICIENTS,
    FAST,
    DisturbanceObserver,
    ObserverNoise,
    law_parts,
    new_belief,
    observe,
    sensor_errors,
    sliding_law,
)
from friction_benchmark.models.steady_motion import AVERAGED, causal_motion, new_causal_motion

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

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


def averaged(position_m: np.ndarray) -> np.ndarray:
    average = FirFilter(moving_average_taps(AVERAGED)[None, None, :])
    return np.ascontiguousarray(average.advance(average.new_state(), position_m[:, None])[:, 0])


def mae_n(estimator: FrictionEstimator, recordings: list[Recording], since: int = 0) -> float:
    errors = [np.abs(estimator.estimate(r) - r.column("friction_n"))[since:].mean() for r in recordings]
    return float(np.mean(errors))


@pytest.fixture(scope="module")
def drifting(cylinder: Cylinder, labelled_recordings: list[Recording]) -> DisturbanceObserver:
    observer = DisturbanceObserver(cylinder, evaluations=30, recordings=4)
    observer.fit(with_sensor_errors(labelled_recordings, 0))
    return observer


def test_with_wrong_sensors_it_leaves_a_small_part_of_the_low_pass_error(
    cylinder: Cylinder, drifting: DisturbanceObserver, labelled_recordings: list[Recording]
) -> None:
    unseen = with_sensor_errors(labelled_recordings, 1)
    baseline = LowPassForceBalanceEstimator(cylinder)
    baseline.fit(with_sensor_errors(labelled_recordings, 0))
    assert mae_n(drifting, unseen) < 0.25 * mae_n(baseline, unseen)


def test_with_right_sensors_it_is_no_worse_than_the_low_pass(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    observer, baseline = (
        DisturbanceObserver(cylinder, evaluations=30, recordings=4),
        LowPassForceBalanceEstimator(cylinder),
    )
    observer.fit(labelled_recordings)
    baseline.fit(labelled_recordings)
    assert observer.noise.bias_n < 10.0
    assert mae_n(observer, labelled_recordings) < mae_n(baseline, labelled_recordings)


def test_how_far_the_sensors_are_off_is_measured(cylinder: Cylinder, drifting: DisturbanceObserver) -> None:
    # Uniform within ±1.25 bar on both areas: 1.25 bar / sqrt(3) times the root of the sum of squared areas, 288 N.
    assert 120.0 < drifting.noise.bias_n < 450.0
    assert 0.5 < drifting.noise.bias_rate_n_s < 8.0


def test_sensor_errors_of_a_known_ramp() -> None:
    time_s = STEP_S * np.arange(4000)
    mask = np.ones(4000, dtype=bool)
    found = sensor_errors([(100.0 + 3.0 * time_s, mask), (-100.0 - 3.0 * time_s, mask)], STEP_S)
    assert found["bias_n"] == pytest.approx(100.0, rel=0.02)
    assert found["bias_rate_n_s"] == pytest.approx(3.0, rel=0.02)
    assert found["bias_walk_n"] == pytest.approx(0.01)
    assert sensor_errors([(np.ones(10), np.zeros(10, dtype=bool))], STEP_S) == {}


def test_an_hour_leaves_the_covariance_symmetric_and_positive_definite() -> None:
    generator = np.random.default_rng(0)
    noise = ObserverNoise(bias_n=288.0, bias_rate_n_s=3.0)
    belief = new_belief(noise, AREAS)
    gains = constant_jerk(12.0, 3.5e-5, STEP_S).gains().filter[-1]
    coefficients = np.zeros((2, COEFFICIENTS))
    coefficients[:, 0], coefficients[:, 6] = 240.0, 4.0
    motion_state = new_causal_motion()
    time_s = STEP_S * np.arange(6000)
    for minute in range(120):  # of half a minute each
        position = 0.1 + 0.02 * np.sin(0.8 * time_s) * (minute % 3 > 0) + generator.normal(0.0, 3e-5, 6000)
        motion = causal_motion(position, averaged(position), gains, STEP_S, motion_state)
        balance = 300.0 * motion[:, 2] + 200.0 + generator.normal(0.0, 10.0 if minute % 5 else 3e3, 6000)
        found = observe(
            motion, balance, np.full(6000, 30.0), coefficients, noise.packed(), AREAS, STEP_S,
            belief.mean, belief.covariance, belief.last,
        )  # fmt: skip
        assert np.isfinite(found).all()
        np.testing.assert_array_equal(belief.covariance, belief.covariance.T)
        np.linalg.cholesky(belief.covariance)


def test_one_correction_is_the_textbook_one() -> None:
    """At rest and within the gate, one row equals predict and correct with plain matrices."""
    noise = ObserverNoise(bias_n=50.0, gate=1e3)
    belief = new_belief(noise, AREAS)
    before = belief.covariance.copy()
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
    predicted = transition @ before @ transition.T + process
    row = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0])
    gain = predicted @ row / (row @ predicted @ row + noise.balance_n**2)
    found = observe(
        np.zeros((1, 4)), np.array([80.0]), np.zeros(1), np.zeros((2, COEFFICIENTS)), noise.packed(), AREAS, STEP_S,
        belief.mean, belief.covariance, belief.last,
    )  # fmt: skip
    left = np.eye(7) - np.outer(gain, row)
    expected = left @ predicted @ left.T + noise.balance_n**2 * np.outer(gain, gain)
    np.testing.assert_allclose(belief.covariance, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(belief.mean, [0, 0, 0, 0, 1, 0, 0] + gain * 80.0, rtol=1e-9)
    np.testing.assert_allclose(found[0], [belief.mean[5] + belief.mean[FAST], belief.mean[BIAS_1] + belief.mean[1]])


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


def test_motion_is_exactly_zero_at_standstill_and_right_while_moving() -> None:
    generator = np.random.default_rng(0)
    gains = constant_jerk(12.0, 3.5e-5, STEP_S).gains().filter[-1]
    speeds = np.repeat([0.0, 0.03, 0.0, -0.03], 400)
    position = 0.1 + np.cumsum(speeds) * STEP_S + generator.normal(0.0, 3e-5, 1600)
    motion = causal_motion(position, averaged(position), gains, STEP_S, new_causal_motion())
    assert (motion[:390, 0] == 0.0).all()
    assert (motion[960:1190, 0] == 0.0).all()
    assert motion[500:790, 0].mean() == pytest.approx(0.03, rel=0.01)
    assert set(motion[900:1190, 2]) == {1.0}
    assert set(motion[1300:, 2]) == {-1.0}


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_noise_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="ObserverNoise: slow_n must be a positive number, but got"):
        ObserverNoise(slow_n=value)


def test_no_evaluations_are_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match="expected at least one evaluation and recording, but got 0 and 16"):
        DisturbanceObserver(cylinder, evaluations=0)
