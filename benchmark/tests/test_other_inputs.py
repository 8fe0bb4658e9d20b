"""Every participant of the benchmark on inputs other than the raw sample: it sees those, and nothing else."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.loading import load_estimator
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

INPUTS = {
    "pressure_free": ("position_m", "oil_temperature_c"),
    "pressure_level": ("position_m", "oil_temperature_c", "pressure_1_level_pa", "pressure_2_level_pa"),
}
CASES = [
    (task, name)
    for task, inputs in INPUTS.items()
    for name, entry in registered_models().items()
    if entry.supports(inputs)
]
EFFORT = 0.02


@pytest.fixture(scope="module")
def recordings(labelled_recordings: list[Recording]) -> list[Recording]:
    result = []
    for number, recording in enumerate(labelled_recordings):
        time_s = recording.column("time_s")
        more = {f"pressure_{side}_level_pa": recording.column(f"pressure_{side}_pa").cumsum() for side in (1, 2)}
        more = {name: values / np.arange(1, len(values) + 1) for name, values in more.items()}
        result.append(recording.with_columns(oil_temperature_c=30.0 + number + 0.01 * time_s, **more))
    return result


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(case))
def estimator(request: pytest.FixtureRequest, cylinder: Cylinder, recordings: list[Recording]) -> FrictionEstimator:
    task, name = request.param
    entry = registered_models()[name]
    made = entry.build(BuildConfiguration(cylinder, INPUTS[task], 0, EFFORT, entry.defaults))
    made.fit(recordings)
    return made


def test_it_sees_what_it_is_given_and_nothing_else(estimator: FrictionEstimator, recordings: list[Recording]) -> None:
    recording = recordings[0]
    assert estimator.inputs != ("pressure_1_pa", "pressure_2_pa", "position_m")
    hidden = [name for name in ("pressure_1_pa", "pressure_2_pa") if name not in estimator.inputs]
    changed = recording.with_columns(**{name: recording.column(name)[::-1] + 1e5 for name in hidden})
    estimate = estimator.estimate(recording)
    assert estimate.shape == (len(recording),)
    assert np.isfinite(estimate).all()
    np.testing.assert_array_equal(estimator.estimate(changed), estimate)


def test_cutting_the_input_into_pieces_changes_nothing(
    estimator: FrictionEstimator, recordings: list[Recording]
) -> None:
    samples = recordings[1].samples(estimator.inputs)[:400]
    state = estimator.new_state()
    pieces = [
        estimator.advance(state, samples[start:end]) for start, end in itertools.pairwise([0, 1, 2, 77, 203, 400])
    ]
    np.testing.assert_array_equal(np.concatenate(pieces), estimator.advance(estimator.new_state(), samples))


def test_save_and_load_round_trip(estimator: FrictionEstimator, recordings: list[Recording], tmp_path: Path) -> None:
    estimator.save(tmp_path / "model")
    loaded = load_estimator(tmp_path / "model")
    assert loaded.inputs == estimator.inputs
    np.testing.assert_array_equal(loaded.estimate(recordings[0]), estimator.estimate(recordings[0]))
