import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.analytical import AnalyticalEstimator, scaled_effort
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator, condition_of_smallest_friction
from cylinder_friction.friction_models.catalogue import model_named
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, RecordingError

NAMES = ["lugre", "pressure_lugre"]
LEVELS = ("position_m", "oil_temperature_c", "pressure_1_level_pa", "pressure_2_level_pa")


def made(name: str, cylinder: Cylinder, inputs: tuple[str, ...] = SAMPLE_COLUMNS, seed: int = 1) -> AnalyticalEstimator:
    return AnalyticalEstimator(cylinder, model_named(name), inputs, effort=scaled_effort(0.02, seed))


@pytest.fixture(scope="module")
def fitted(cylinder: Cylinder, labelled_recordings: list[Recording]) -> dict[str, AnalyticalEstimator]:
    return {name: made(name, cylinder).fit(labelled_recordings) for name in NAMES}


def with_levels(recording: Recording) -> Recording:
    """Return a recording with levels: its pressures behind a low-pass, which differ from them."""
    levels = {
        column.replace("_pa", "_level_pa"): np.convolve(recording.column(column), np.full(50, 0.02), mode="same")
        for column in SAMPLE_COLUMNS[:2]
    }
    return recording.with_columns(oil_temperature_c=np.full(len(recording), 40.0), **levels)


@pytest.mark.parametrize("name", NAMES)
def test_it_fits_every_test_at_once(
    name: str, fitted: dict[str, AnalyticalEstimator], labelled_recordings: list[Recording]
) -> None:
    """Friction of these recordings is a static curve that grows with pressure; without pressure its mean is left."""
    found = fitted[name].identification
    assert found is not None
    assert found.error_percent < (9.0 if name == "pressure_lugre" else 25.0)
    label = np.concatenate([recording.column("friction_n") for recording in labelled_recordings])
    estimate = np.concatenate([fitted[name].estimate(recording) for recording in labelled_recordings])
    assert found.error_n == pytest.approx(float(np.abs(estimate - label).mean()), rel=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_saving_and_loading_keeps_units_and_intervals(
    name: str, fitted: dict[str, AnalyticalEstimator], tmp_path: Path
) -> None:
    estimator = fitted[name]
    estimator.save(tmp_path)
    loaded = load_estimator(tmp_path)
    assert isinstance(loaded, AnalyticalEstimator)
    assert loaded.model.name == name
    assert loaded.intervals == estimator.intervals
    content = json.loads((tmp_path / "estimator.json").read_text())["parameters"]["model"]
    assert {key: entry["unit"] for key, entry in content.items()} == {
        spec.name: spec.unit for spec in estimator.model.specs
    }
    for spec in estimator.model.searched:
        lower, upper = content[spec.name]["interval"]
        assert lower <= content[spec.name]["value"] <= upper


def test_only_a_model_that_uses_pressure_feels_it(
    fitted: dict[str, AnalyticalEstimator], labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    other = recording.with_columns(pressure_2_pa=recording.column("pressure_2_pa") + 3e6)
    for name in NAMES:
        felt = np.abs(fitted[name].estimate(other) - fitted[name].estimate(recording)).mean()
        assert felt > 20.0 if name == "pressure_lugre" else felt == 0.0


def test_levels_of_pressure_do_where_raw_pressures_are_not_seen(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    levelled = [with_levels(recording) for recording in labelled_recordings]
    estimator = made("pressure_lugre", cylinder, LEVELS).fit(levelled)
    before = estimator.estimate(levelled[0])
    hidden = levelled[0].with_columns(pressure_1_pa=np.zeros(len(before)), pressure_2_pa=np.zeros(len(before)))
    np.testing.assert_array_equal(estimator.estimate(hidden), before)
    risen = levelled[0].with_columns(pressure_2_level_pa=levelled[0].column("pressure_2_level_pa") + 3e6)
    assert np.abs(estimator.estimate(risen) - before).mean() > 20.0


def test_one_condition_alone_is_the_paper_s_way(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    first = [recording for recording in labelled_recordings if recording.metadata.condition == "1"]
    one, same = (
        AnalyticalEstimator(cylinder, LuGre(), condition=condition, effort=scaled_effort(0.02))
        for condition in ("1", None)
    )
    one.fit(labelled_recordings)
    same.fit(first)
    assert one.parameters == same.parameters
    missing = AnalyticalEstimator(cylinder, LuGre(), condition="no load")
    with pytest.raises(RecordingError, match=r"of condition 'no load'; got conditions \['1', '2', '3', '4'\]"):
        missing.fit(labelled_recordings)


def test_more_effort_searches_more(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    budgets = []
    for effort in (0.02, 0.1):
        estimator = AnalyticalEstimator(cylinder, LuGre(), effort=scaled_effort(effort)).fit(labelled_recordings[:2])
        assert estimator.identification is not None
        budgets.append(len(estimator.identification.history))
    assert budgets[1] > 1.5 * budgets[0]
    with pytest.raises(ValueError, match=r"expected an effort above 0 and at most 1, but got 0\.0"):
        scaled_effort(0.0)


def test_missing_inputs_are_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match=r"lugre: inputs are \['pressure_1_pa'\], but expected position_m among them"):
        AnalyticalEstimator(cylinder, LuGre(), ("pressure_1_pa",))
    with pytest.raises(ValueError, match="expected one pair of pressures among them: pressure_1_pa and pressure_2_pa"):
        AnalyticalEstimator(cylinder, LuGre(pressure_scaled=True), ("position_m",))


@pytest.fixture(scope="module")
def searched(cylinder: Cylinder, labelled_recordings: list[Recording]) -> dict[str, LugreEstimator]:
    small: dict[str, Any] = {"condition": "1", "seed": 1, "population": 3, "generations": 3, "simulated_recordings": 1}
    return {
        kind.kind: kind(cylinder, **small).fit(labelled_recordings) for kind in (LugreEstimator, PressureLugreEstimator)
    }


def error_percent(estimator: FrictionEstimator, recordings: list[Recording], condition: str) -> float:
    chosen = [recording for recording in recordings if recording.metadata.condition == condition]
    label = np.concatenate([recording.column("friction_n") for recording in chosen])
    estimate = np.concatenate([estimator.estimate(recording) for recording in chosen])
    return 100.0 * float(np.abs(estimate - label).mean() / np.abs(label).mean())


@pytest.mark.extended
def test_plain_lugre_fits_its_own_test_and_fails_under_load(
    searched: dict[str, LugreEstimator], labelled_recordings: list[Recording]
) -> None:
    errors = [error_percent(searched["lugre"], labelled_recordings, condition) for condition in "1234"]
    assert errors[0] < 6.0
    assert errors[0] < errors[1] < errors[2] < errors[3]
    assert errors[3] > 3.0 * errors[0]


@pytest.mark.extended
def test_one_pressure_slope_found_without_load_carries_to_the_loads(
    searched: dict[str, LugreEstimator], labelled_recordings: list[Recording]
) -> None:
    for condition in "1234":
        assert error_percent(searched["pressure_lugre"], labelled_recordings, condition) < 6.0


@pytest.mark.extended
def test_without_a_condition_it_is_identified_where_friction_is_smallest(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    assert condition_of_smallest_friction(labelled_recordings[::-1]) == "1"
    estimator = LugreEstimator(cylinder, population=3, generations=1, simulated_recordings=1)
    assert estimator.fit(labelled_recordings).condition == "1"
    assert repr(estimator).startswith("<LugreEstimator(condition='1', inputs=('pressure_1_pa',")
