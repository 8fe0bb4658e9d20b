"""The flag fires on what training never had: a higher pressure, a faster stroke; and not on what it had."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.realtime.guard import TrainingRange
from friction_benchmark.datasets import Sources, folds_of, training_cases, twin_recordings
from friction_benchmark.extrapolation import outside, range_of, training_range
from friction_benchmark.folds import HELD_OUT, LEAVE_LOAD, UNSEEN_RIG
from friction_benchmark.tasks import task_named
from friction_benchmark_models import CYLINDER, SIZES, write_campaign

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.recordings.recording import Recording

INPUTS = ("pressure_1_pa", "pressure_2_pa", "position_m")
FORECAST = task_named("forecast_250ms")


@pytest.fixture
def known(labelled_recordings: list[Recording]) -> TrainingRange:
    return range_of(labelled_recordings, INPUTS)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Sources:
    folder: Path = tmp_path_factory.mktemp("campaigns")
    made = Sources(folder, SIZES, CYLINDER)
    for kind in ("campaign", "unseen", "twin"):
        write_campaign(made, kind, 0)
    return made


def test_the_training_recordings_are_inside(known: TrainingRange, labelled_recordings: list[Recording]) -> None:
    assert not any(outside(known, recording).any() for recording in labelled_recordings)


def test_a_pressure_never_seen_is_outside_while_it_lasts(
    known: TrainingRange, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    pressure = recording.column("pressure_1_pa").copy()
    pressure[100:200] += 1e8
    flagged = outside(known, recording.with_columns(pressure_1_pa=pressure))
    np.testing.assert_array_equal(np.flatnonzero(flagged), np.arange(100, 200))


def test_a_speed_never_seen_is_outside_though_every_input_is_inside(labelled_recordings: list[Recording]) -> None:
    slow = labelled_recordings[0]
    known = range_of([slow], ("position_m",))
    position = slow.column("position_m")
    stroke = np.linspace(position.min(), position.max(), 40)
    position = np.concatenate([np.full(500, stroke[0]), stroke, np.full(len(position) - 540, stroke[-1])])
    flagged = outside(known, slow.with_columns(position_m=position))
    assert flagged[510:540].all()
    assert not flagged[:500].any()
    assert not flagged[600:].any()


@pytest.mark.parametrize("of_now", [False, True])
def test_the_range_is_that_of_the_training_recordings_whatever_their_target(sources: Sources, of_now: bool) -> None:
    fold = folds_of(sources, FORECAST, HELD_OUT, 0)[0]
    cases = training_cases(sources, FORECAST, 0, of_now=of_now)
    found = training_range(sources, FORECAST, 0, fold.train, INPUTS)
    assert found == range_of([cases[name].recording for name in fold.train], INPUTS)


def test_a_model_trained_on_the_twin_has_its_range(sources: Sources) -> None:
    found = training_range(sources, FORECAST, 0, (), INPUTS)
    assert found == range_of(twin_recordings(sources, FORECAST, 0), INPUTS)


def test_the_range_is_made_once_for_the_models_and_splits_that_share_it(sources: Sources) -> None:
    training_range.cache_clear()
    for _ in ("one model", "another"):
        for split in (HELD_OUT, UNSEEN_RIG, LEAVE_LOAD):
            for fold in folds_of(sources, FORECAST, split, 0):
                training_range(sources, FORECAST, 0, fold.train, INPUTS)
    assert training_range.cache_info().misses == 1 + 4
    assert training_range.cache_info().hits == 7
