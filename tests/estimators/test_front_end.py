"""What scales the features that a network sees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.features import FeatureBlock, fit_features
from cylinder_friction.estimators.front_end import Design, FeatureMaker, FrontEndBlock, fit_front_end
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.cylinder import Cylinder
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


def seen(block: FeatureMaker, inputs: Sequence[str], recordings: Sequence[Recording]) -> np.ndarray:
    rows = [
        block.advance(block.new_state(), recording.samples(inputs))[0][recording.usable()] for recording in recordings
    ]
    return np.concatenate(rows).astype(np.float64)


@pytest.mark.parametrize("design", ["paper", "force_balance"])
def test_usable_rows_of_training_have_mean_nought_and_deviation_one(
    design: Design, cylinder: Cylinder, recordings: list[Recording]
) -> None:
    rows = seen(FrontEndBlock(fit_front_end(design, cylinder, recordings)), SAMPLE_COLUMNS, recordings)
    np.testing.assert_allclose(rows.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(rows.std(axis=0), 1.0, atol=1e-3)


def test_features_of_any_sensors_are_scaled_alike(cylinder: Cylinder, recordings: list[Recording]) -> None:
    features = fit_features(("position_m",), cylinder, recordings)
    rows = seen(FeatureBlock(features), ("position_m",), recordings)
    np.testing.assert_allclose(rows.mean(axis=0), 0.0, atol=1e-3)
    dwell = features.names.index("dwell")  # nothing here rests longer than the play tells
    np.testing.assert_allclose(np.delete(rows, dwell, axis=1).std(axis=0), 1.0, atol=1e-3)


def test_a_column_that_never_varies_is_centred_and_not_divided(cylinder: Cylinder, recordings: list[Recording]) -> None:
    features = fit_features(WARM, cylinder, recordings)
    column = features.names.index("oil_temperature_c_20")
    assert features.front_end.scale[column] == 1.0
    assert np.abs(seen(FeatureBlock(features), WARM, recordings)[:, column]).max() < 1e-4
