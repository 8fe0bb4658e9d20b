from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
from cylinder_friction.recordings.recording import RecordingError
from presliding_stiffness import PreslidingStiffness, presliding_stiffness

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array

STEP_S = 1e-3
MODEL = LugreParameters(300.0, 300.0, 0.01, 1.0, 0.0, 2e6, 0.0, 0.01)


def strokes(model: LugreParameters = MODEL, seconds: float = 40.0) -> tuple[Array, Array]:
    """Return position and friction of a sine of 0.6 mm either way, half a period a second."""
    time_s = STEP_S * np.arange(round(seconds / STEP_S))
    position_m = 0.1 + 6e-4 * np.sin(np.pi * time_s)
    velocity = np.diff(position_m, prepend=position_m[0]) / STEP_S
    return position_m, LuGre().simulate(model.packed(), velocity, STEP_S, LuGre().new_state(), None)


def found(noise_n: float = 0.0, seed: int = 0) -> PreslidingStiffness:
    position_m, friction_n = strokes()
    noise = np.random.default_rng(seed).normal(0.0, noise_n, len(friction_n)) if noise_n else 0.0
    return presliding_stiffness(position_m, friction_n + noise, 1e-4)


def test_bristle_stiffness_of_lugre_is_found() -> None:
    result = found()
    assert result.stiffness_n_m == pytest.approx(2e6, rel=0.03)
    assert result.extend_n_m == pytest.approx(result.retract_n_m, rel=0.01)
    assert result.coulomb_n == pytest.approx(300.0, rel=0.01)
    assert min(result.reversals_extend, result.reversals_retract) >= 18
    assert result.left_out == 0


@pytest.mark.parametrize("level", [0.3, 0.5, 0.7])
def test_the_share_of_friction_that_counts_hardly_matters(level: float) -> None:
    result = presliding_stiffness(*strokes(), 1e-4, level)
    assert result.stiffness_n_m == pytest.approx(2e6, rel=0.06)


def test_interval_holds_the_noiseless_value_as_often_as_it_says() -> None:
    noiseless = found().stiffness_n_m
    results = [found(10.0, seed) for seed in range(40)]
    assert np.mean([low < noiseless < high for low, high in (each.interval_n_m for each in results)]) >= 0.85
    assert np.mean([high - low for low, high in (each.interval_n_m for each in results)]) < 0.05 * noiseless


def test_compliance_in_series_lowers_it() -> None:
    """1 / (1 / 2e6 + 1 / 2e6): the sensor of position stands behind a spring."""
    position_m, friction_n = strokes()
    result = presliding_stiffness(position_m + friction_n / 2e6, friction_n, 1e-4)
    assert result.stiffness_n_m == pytest.approx(1e6, rel=0.05)


def test_noise_of_position_makes_no_reversal() -> None:
    position_m, friction_n = strokes()
    noisy_m = position_m + np.random.default_rng(0).normal(0.0, 1e-6, len(position_m))
    result = presliding_stiffness(noisy_m, friction_n, 1e-4)
    assert result.reversals_extend == found().reversals_extend
    assert result.stiffness_n_m == pytest.approx(2e6, rel=0.05)


def test_json_takes_it() -> None:
    assert json.loads(json.dumps(found().to_dict(), allow_nan=False))["interval_n_m"][0] > 0.0


def test_friction_of_the_wrong_sign_is_refused() -> None:
    position_m, friction_n = strokes()
    with pytest.raises(RecordingError, match=r"got 0 reversals to extension and 0 to retraction that show friction"):
        presliding_stiffness(position_m, -friction_n, 1e-4)


def test_too_few_reversals_are_refused() -> None:
    position_m, friction_n = strokes(seconds=3.0)
    with pytest.raises(RecordingError, match=r"expected at least 3 of each; .* or lower least_travel_m \(0\.0001 m\)"):
        presliding_stiffness(position_m, friction_n, 1e-4)
    with pytest.raises(RecordingError, match="got 0 reversals"):
        presliding_stiffness(np.full(100, 0.1), np.zeros(100), 1e-4)


@pytest.mark.parametrize("how", [{"level": 1.0}, {"confidence": 0.0}, {"least_travel_m": 0.0}])
def test_impossible_arguments_are_refused(how: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="expected level and confidence between 0 and 1 and a positive least_travel_m"):
        presliding_stiffness(*strokes(seconds=5.0), **({"least_travel_m": 1e-4} | how))
