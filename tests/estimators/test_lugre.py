import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator, condition_of_smallest_friction
from cylinder_friction.recordings.recording import Recording

KINDS = (LugreEstimator, PressureLugreEstimator)


def small(kind: type[LugreEstimator], cylinder: Cylinder) -> LugreEstimator:
    return kind(cylinder, condition="1", seed=1, population=3, generations=3, simulated_recordings=1)


@pytest.fixture(scope="module")
def fitted(cylinder: Cylinder, labelled_recordings: list[Recording]) -> dict[str, LugreEstimator]:
    estimators = {kind.kind: small(kind, cylinder) for kind in KINDS}
    for estimator in estimators.values():
        estimator.fit(labelled_recordings)
    return estimators


def error_percent(estimator: FrictionEstimator, recordings: list[Recording], condition: str) -> float:
    chosen = [recording for recording in recordings if recording.metadata.condition == condition]
    label = np.concatenate([recording.column("friction_n") for recording in chosen])
    estimate = np.concatenate([estimator.estimate(recording) for recording in chosen])
    return 100.0 * float(np.abs(estimate - label).mean() / np.abs(label).mean())


def test_plain_lugre_fits_its_own_test_and_fails_under_load(
    fitted: dict[str, LugreEstimator], labelled_recordings: list[Recording]
) -> None:
    errors = [error_percent(fitted["lugre"], labelled_recordings, condition) for condition in "1234"]
    assert errors[0] < 6.0
    assert errors[0] < errors[1] < errors[2] < errors[3]
    assert errors[3] > 3.0 * errors[0]


def test_one_pressure_slope_found_without_load_carries_to_the_loads(
    fitted: dict[str, LugreEstimator], labelled_recordings: list[Recording]
) -> None:
    for condition in "1234":
        assert error_percent(fitted["pressure_lugre"], labelled_recordings, condition) < 6.0


def test_without_a_condition_it_is_identified_where_friction_is_smallest(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    assert condition_of_smallest_friction(labelled_recordings[::-1]) == "1"
    estimator = LugreEstimator(cylinder, population=3, generations=1, simulated_recordings=1)
    assert estimator.fit(labelled_recordings).condition == "1"
    assert repr(estimator).startswith("<LugreEstimator(condition='1', inputs=('pressure_1_pa',")
