"""Folds: whole sessions in one role, the group that is left out nowhere but in the test."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cylinder_friction.recordings.recording import RecordingError, RecordingMetadata
from cylinder_friction.recordings.splits import split_sessions
from friction_benchmark.folds import (
    HELD_OUT,
    UNSEEN_RIG,
    Fold,
    held_out,
    leave_one_load_out,
    leave_one_temperature_out,
    refuse_leaks,
    unseen_rig,
)
from friction_benchmark_models import made_recording


def two_recordings_per_session() -> list[RecordingMetadata]:
    first = [made_recording(test, session).recording.metadata for test in "1234" for session in range(1, 5)]
    return [replace(entry, name=f"{entry.session}_recording0{take}") for entry in first for take in (1, 2)]


METADATA = two_recordings_per_session()
SESSION = {entry.name: entry.session for entry in METADATA}
TEST = {entry.name: entry.condition for entry in METADATA}
BASE = held_out(split_sessions(METADATA, 1, 1, 0))
TEMPERATURE = {entry.name: 20.0 + int(entry.session[-2:]) + 0.1 * int(entry.condition) for entry in METADATA}


def every_fold() -> list[Fold]:
    return [
        BASE,
        *leave_one_load_out(BASE, METADATA),
        *leave_one_temperature_out(BASE, METADATA, TEMPERATURE),
        unseen_rig(BASE, METADATA),
    ]


@pytest.mark.parametrize("fold", every_fold(), ids=lambda fold: f"{fold.split} {fold.left_out}".strip())
def test_no_session_has_two_roles(fold: Fold) -> None:
    refuse_leaks(fold, METADATA)
    if fold.split != UNSEEN_RIG:
        roles = [{SESSION[name] for name in names} for names in (fold.train, fold.validation, fold.test)]
        assert not roles[0] & roles[1]
        assert not roles[0] & roles[2]
        assert not roles[1] & roles[2]


def test_a_load_that_is_left_out_trains_nobody_and_all_of_it_is_tested() -> None:
    folds = leave_one_load_out(BASE, METADATA)
    assert [fold.left_out for fold in folds] == ["1", "2", "3", "4"]
    for fold in folds:
        assert {TEST[name] for name in fold.test} == {fold.left_out}
        assert fold.left_out not in {TEST[name] for name in (*fold.train, *fold.validation)}
        assert len(fold.test) == 8


def test_every_recording_is_tested_once_where_something_is_left_out() -> None:
    for folds in (leave_one_load_out(BASE, METADATA), leave_one_temperature_out(BASE, METADATA, TEMPERATURE)):
        asked = [name for fold in folds for name in fold.test]
        assert sorted(asked) == sorted(SESSION)


def test_cold_oil_is_tested_after_training_on_warmer_oil_alone() -> None:
    folds = {fold.left_out: fold for fold in leave_one_temperature_out(BASE, METADATA, TEMPERATURE)}
    coldest_trained = min(TEMPERATURE[name] for name in folds["cold"].train)
    assert max(TEMPERATURE[name] for name in folds["cold"].test) < coldest_trained
    warmest_trained = max(TEMPERATURE[name] for name in folds["warm"].train)
    assert min(TEMPERATURE[name] for name in folds["warm"].test) > warmest_trained


def test_an_unseen_rig_refits_nothing() -> None:
    fold = unseen_rig(BASE, METADATA)
    assert (fold.train, fold.validation) == (BASE.train, BASE.validation)
    assert len(fold.test) == len(METADATA)


def test_a_session_that_trains_and_tests_is_refused() -> None:
    train, test = f"{METADATA[0].session}_recording01", f"{METADATA[0].session}_recording02"
    fold = Fold(HELD_OUT, "", (train,), (BASE.validation[0],), (test,))
    with pytest.raises(
        RecordingError, match=r"session 'condition1_session01' is in train and in test .* expected one role per session"
    ):
        refuse_leaks(fold, METADATA)


def test_a_role_without_recordings_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"no recording has the role validation; expected at least one"):
        refuse_leaks(replace(BASE, validation=()), METADATA)
