import json
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator, condition_of_smallest_friction
from cylinder_friction.friction_models.lugre import LugreParameters
from cylinder_friction.recordings.recording import Recording, RecordingError

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


def test_only_its_own_test_is_looked_at(
    cylinder: Cylinder, fitted: dict[str, LugreEstimator], labelled_recordings: list[Recording]
) -> None:
    alone = small(LugreEstimator, cylinder)
    alone.fit([recording for recording in labelled_recordings if recording.metadata.condition == "1"])
    assert alone.parameters == fitted["lugre"].parameters
    assert alone.training_range == fitted["lugre"].training_range


def test_a_missing_condition_is_refused(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    estimator = LugreEstimator(cylinder, condition="no-load")
    with pytest.raises(RecordingError, match=r"of condition 'no-load'; got conditions \['1', '2', '3', '4'\]"):
        estimator.fit(labelled_recordings)


@pytest.mark.parametrize("kind", [kind.kind for kind in KINDS])
def test_pieces_and_single_samples_equal_the_whole_bit_for_bit(
    kind: str, fitted: dict[str, LugreEstimator], labelled_recordings: list[Recording]
) -> None:
    estimator, recording = fitted[kind], labelled_recordings[3]
    whole = estimator.estimate(recording)
    state = estimator.new_state()
    samples = recording.samples()
    pieces = [estimator.advance(state, part) for part in np.split(samples, [1, 2, 57, 58, 900])]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    stream = estimator.stream()
    np.testing.assert_array_equal([stream.step(*row) for row in samples[:300]], whole[:300])


@pytest.mark.parametrize("kind", [kind.kind for kind in KINDS])
def test_saving_and_loading_changes_no_bit(
    kind: str, fitted: dict[str, LugreEstimator], labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    estimator = fitted[kind]
    estimator.save(tmp_path)
    loaded = load_estimator(tmp_path)
    assert type(loaded) is type(estimator)
    np.testing.assert_array_equal(loaded.estimate(labelled_recordings[0]), estimator.estimate(labelled_recordings[0]))
    assert loaded.intervals == estimator.intervals
    content = json.loads((tmp_path / "estimator.json").read_text())["parameters"]
    units = {spec.name: spec.unit for spec in LugreParameters.specs}
    for name, entry in content["model"].items():
        assert entry["unit"] == units[name]
    lower, upper = content["model"]["coulomb_n"]["interval"]
    assert lower < content["model"]["coulomb_n"]["value"] < upper


def test_plain_lugre_does_not_feel_pressure(
    fitted: dict[str, LugreEstimator], labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    other = recording.with_columns(pressure_2_pa=recording.column("pressure_2_pa") + 3e6)
    np.testing.assert_array_equal(fitted["lugre"].estimate(other), fitted["lugre"].estimate(recording))
    felt = fitted["pressure_lugre"].estimate(other) - fitted["pressure_lugre"].estimate(recording)
    assert np.abs(felt).mean() > 20.0


def test_without_a_condition_it_is_identified_where_friction_is_smallest(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    assert condition_of_smallest_friction(labelled_recordings[::-1]) == "1"
    estimator = LugreEstimator(cylinder, population=3, generations=1, simulated_recordings=1)
    assert estimator.fit(labelled_recordings).condition == "1"
    assert repr(estimator).startswith("<LugreEstimator(condition='1', inputs=('pressure_1_pa',")
