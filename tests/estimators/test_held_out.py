"""Which sessions early stopping goes by, and which are left out for bounds."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.estimators.held_out import FOLDS, KEPT_SESSIONS, folds, held_out_for_stopping
from cylinder_friction.recordings.recording import Recording, RecordingMetadata


def recorded(condition: str, session: str, take: int = 1) -> Recording:
    columns = ("time_s", "pressure_1_pa", "pressure_2_pa", "position_m")
    table = pd.DataFrame({column: 0.005 * np.arange(3) for column in columns})
    return Recording(RecordingMetadata(f"{condition}_{session}_{take}", condition, session, 0.005, "any"), table)


def named(recordings: list[Recording]) -> list[str]:
    return [recording.name for recording in recordings]


def test_the_last_session_of_each_test_is_held_out_whole() -> None:
    recordings = [
        recorded(condition, f"{condition}-{day}", take) for condition in "ab" for day in (3, 1, 2) for take in (1, 2)
    ]
    train, held_out = held_out_for_stopping(recordings)
    assert named(held_out) == ["a_a-3_1", "a_a-3_2", "b_b-3_1", "b_b-3_2"]
    assert named(train) == [recording.name for recording in recordings if recording not in held_out]


@pytest.mark.parametrize("named", ["a1 a2 a3 b4 b5", "a1 b2", "a1 a2 a3 b0 b1 b2"])  # in the last, b shares a's days
def test_the_last_session_alone_is_held_out_where_a_test_has_too_few(named: str) -> None:
    _, held_out = held_out_for_stopping([recorded(*each) for each in named.split()])
    assert {recording.metadata.session for recording in held_out} == {max(session for _, session in named.split())}


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from("123456")), min_size=2, unique=True))
def test_no_session_is_on_both_sides_and_every_test_that_can_teach_does(sessions: list[tuple[str, str]]) -> None:
    recordings = [recorded(*each) for each in sessions]
    train, held_out = held_out_for_stopping(recordings)
    if len({session for _, session in sessions}) == 1:
        assert train == held_out == recordings
        return
    taught, heard = ({recording.metadata.session for recording in side} for side in (train, held_out))
    assert taught
    assert heard
    assert not taught & heard
    assert len(train) + len(held_out) == len(recordings)
    if len(heard) > 1:
        conditions = {condition for condition, _ in sessions}
        assert {recording.metadata.condition for recording in held_out} == conditions
        for condition in conditions:
            assert (
                len({each.metadata.session for each in train if each.metadata.condition == condition}) >= KEPT_SESSIONS
            )


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from("123456")), min_size=2, unique=True))
def test_folds_hold_every_recording_once_and_never_split_a_session(sessions: list[tuple[str, str]]) -> None:
    recordings = [recorded(*each) for each in sessions]
    groups, words = folds(recordings)
    assert sorted(named([each for own in groups for each in own])) == sorted(named(recordings))
    names = [{recording.metadata.session for recording in own} for own in groups]
    count = len({session for _, session in sessions})
    if count > 1:
        assert words == f"{count} sessions"
        assert sum(map(len, names)) == count
        assert len(groups) == min(FOLDS, count)


def test_folds_of_one_session_are_its_recordings_and_of_one_recording_stretches_of_it() -> None:
    groups, words = folds([recorded("a", "a-1", take) for take in (1, 2, 3, 4)])
    assert [named(own) for own in groups] == [["a_a-1_1", "a_a-1_4"], ["a_a-1_2"], ["a_a-1_3"]]
    assert words.startswith("4 recordings of the only session, so that they do not hold how sessions differ")
    groups, words = folds([recorded("a", "a-1")])
    assert [len(own[0]) for own in groups] == [1, 1, 1]
    assert words.startswith("3 stretches of the only recording")
