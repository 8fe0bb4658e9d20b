"""The features that a network sees, and what scales them."""

from collections.abc import Sequence

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.front_end import Design, FrontEnd, feature_count, fit_front_end
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording

WARM = (*SAMPLE_COLUMNS, "oil_temperature_c")


@pytest.fixture(scope="module")
def recordings(labelled_recordings: list[Recording]) -> list[Recording]:
    """Recordings of which not every row is usable, and whose oil is always as warm."""
    made = []
    for recording in labelled_recordings[:3]:
        usable, warm_c = recording.usable().copy(), np.full(len(recording), 40.0)
        usable[:500] = False
        made.append(recording.with_columns(usable=usable, oil_temperature_c=warm_c))
    return made


def seen(features: FrontEnd, inputs: Sequence[str], recordings: Sequence[Recording]) -> np.ndarray:
    rows = [features.run(recording.samples(inputs))[0][recording.usable()] for recording in recordings]
    return np.concatenate(rows).astype(np.float64)


@pytest.mark.parametrize(
    ("design", "inputs"),
    [("paper", SAMPLE_COLUMNS), ("force_balance", SAMPLE_COLUMNS), ("full", ("position_m",))],
)
def test_usable_rows_of_training_have_mean_zero_and_deviation_one(
    design: Design, inputs: tuple[str, ...], cylinder: Cylinder, recordings: list[Recording]
) -> None:
    features = fit_front_end(design, cylinder, recordings, inputs)
    rows = seen(features, inputs, recordings)
    np.testing.assert_allclose(rows.mean(axis=0), 0.0, atol=1e-3)
    moves = [name != "dwell" for name in features.names]  # nothing here rests longer than the backlash shows
    np.testing.assert_allclose(rows[:, moves].std(axis=0), 1.0, atol=1e-3)


def test_a_column_that_never_varies_is_centred_and_not_divided(cylinder: Cylinder, recordings: list[Recording]) -> None:
    features = fit_front_end("full", cylinder, recordings, WARM)
    column = features.names.index("oil_temperature_c_20")
    assert features.scale[column] == 1.0
    assert np.abs(seen(features, WARM, recordings)[:, column]).max() < 1e-4


@pytest.mark.parametrize("inputs", [SAMPLE_COLUMNS, WARM, ("position_m",), ("position_m", "pressure_2_pa")])
@pytest.mark.parametrize("design", ["force_balance", "full"])
def test_the_number_of_features_is_known_before_they_are_fitted(
    design: Design, inputs: tuple[str, ...], cylinder: Cylinder, recordings: list[Recording]
) -> None:
    front_end = fit_front_end(design, cylinder, recordings, inputs)
    assert len(front_end.names) == feature_count(design, inputs)
    rows, _ = front_end.run(np.zeros((3, len(inputs))))
    assert rows.shape == (3, len(front_end.names))


def test_a_measured_load_is_part_of_the_force_that_is_corrected(
    cylinder: Cylinder, recordings: list[Recording]
) -> None:
    loaded = []
    for number, recording in enumerate(recordings):
        load_n = np.full(len(recording), 300.0 * number)
        pressure_1_pa = recording.column("pressure_1_pa") + load_n / cylinder.piston_area_m2
        loaded.append(recording.with_columns(pressure_1_pa=pressure_1_pa, load_force_n=load_n))
    plain = fit_front_end("force_balance", cylinder, recordings)
    aware = fit_front_end("force_balance", cylinder, loaded, (*SAMPLE_COLUMNS, "load_force_n"))
    assert plain.base_taps is not None
    assert aware.base_taps is not None
    np.testing.assert_allclose(aware.base_taps[:, :3], plain.base_taps, rtol=1e-6)


def test_inputs_without_the_position_are_refused(cylinder: Cylinder, recordings: list[Recording]) -> None:
    with pytest.raises(ValueError, match=r"expected position_m among the inputs, but got \('pressure_1_pa',\)"):
        fit_front_end("full", cylinder, recordings, ("pressure_1_pa",))
    with pytest.raises(ValueError, match="expected pressure_1_pa, pressure_2_pa, position_m among the inputs"):
        fit_front_end("paper", cylinder, recordings, ("position_m",))
