"""The flag fires on what was never taught: a higher pressure, a faster stroke; and not on what was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.realtime.guard import TrainingRange
from friction_benchmark.data import Sources, folds_of, lessons_of, twin_lessons_of
from friction_benchmark.flags import VELOCITY, outside, taught_range, with_causal_velocity
from friction_benchmark.folds import HELD_OUT, LEAVE_LOAD, UNSEEN_RIG
from friction_benchmark.tasks import task_named
from friction_benchmark_models import SIZES, write_campaign

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.recordings.recording import Recording

INPUTS = ("pressure_1_pa", "pressure_2_pa", "position_m")
FORECAST = task_named("forecast_250ms")


def known_from(recordings: list[Recording], inputs: tuple[str, ...] = INPUTS) -> TrainingRange:
    return TrainingRange.of([with_causal_velocity(recording) for recording in recordings], (*inputs, VELOCITY))


@pytest.fixture
def known(labelled_recordings: list[Recording]) -> TrainingRange:
    return known_from(labelled_recordings)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Sources:
    folder: Path = tmp_path_factory.mktemp("campaigns")
    made = Sources(folder, SIZES)
    for kind in ("campaign", "unseen", "twin"):
        write_campaign(made, kind, 0)
    return made


def test_what_was_taught_is_inside(known: TrainingRange, labelled_recordings: list[Recording]) -> None:
    assert not any(outside(known, with_causal_velocity(recording)).any() for recording in labelled_recordings)


def test_a_pressure_never_taught_is_outside_while_it_lasts(
    known: TrainingRange, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    pressure = recording.column("pressure_1_pa").copy()
    pressure[100:200] += 1e8
    flagged = outside(known, with_causal_velocity(recording.with_columns(pressure_1_pa=pressure)))
    np.testing.assert_array_equal(np.flatnonzero(flagged), np.arange(100, 200))


def test_a_speed_never_taught_is_outside_though_every_input_is_inside(labelled_recordings: list[Recording]) -> None:
    slow = labelled_recordings[0]
    known = known_from([slow], ("position_m",))
    position = slow.column("position_m")
    stroke = np.linspace(position.min(), position.max(), 40)
    position = np.concatenate([np.full(500, stroke[0]), stroke, np.full(len(position) - 540, stroke[-1])])
    flagged = outside(known, with_causal_velocity(slow.with_columns(position_m=position)))
    assert flagged[510:540].all()
    assert not flagged[:500].any()
    assert not flagged[600:].any()


def test_both_velocities_agree_on_a_clean_recording(labelled_recordings: list[Recording]) -> None:
    recording = labelled_recordings[0]
    apart = np.abs(with_causal_velocity(recording).column(VELOCITY) - recording.column(VELOCITY))
    assert np.quantile(apart[50:], 0.99) < 5e-3


@pytest.mark.parametrize("of_now", [False, True])
def test_the_taught_range_is_that_of_the_lessons_whichever_friction_they_teach(sources: Sources, of_now: bool) -> None:
    fold = folds_of(sources, FORECAST, HELD_OUT, 0)[0]
    lessons = lessons_of(sources, FORECAST, 0, of_now=of_now)
    found = taught_range(sources, FORECAST, 0, fold.train, INPUTS, causal=True)
    assert found == known_from([lessons[name].recording for name in fold.train])


def test_whoever_is_taught_by_the_twin_knows_its_range(sources: Sources) -> None:
    found = taught_range(sources, FORECAST, 0, (), INPUTS, causal=True)
    assert found == known_from(list(twin_lessons_of(sources, FORECAST, 0)))


def test_the_range_is_made_once_for_the_models_and_splits_that_share_it(sources: Sources) -> None:
    taught_range.cache_clear()
    for _ in ("one model", "another"):
        for split in (HELD_OUT, UNSEEN_RIG, LEAVE_LOAD):
            for fold in folds_of(sources, FORECAST, split, 0):
                taught_range(sources, FORECAST, 0, fold.train, INPUTS, causal=False)
    assert taught_range.cache_info().misses == 1 + 4
    assert taught_range.cache_info().hits == 7


def test_the_judge_goes_by_the_off_line_velocity(sources: Sources) -> None:
    fold = folds_of(sources, FORECAST, HELD_OUT, 0)[0]
    causal, off_line = (
        taught_range(sources, FORECAST, 0, fold.train, INPUTS, causal=causal) for causal in (True, False)
    )
    assert causal.lower[:-1] == off_line.lower[:-1]
    assert causal.lower[-1] < off_line.lower[-1] < 0.0  # noise widens what is seen from samples until now
