from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.recordings.recording import RecordingError, RecordingMetadata
from cylinder_friction.recordings.splits import ROLES, split_sessions


def campaign(sessions: dict[str, int], recordings: int = 2) -> list[RecordingMetadata]:
    return [
        RecordingMetadata(f"test{condition}_s{session}_r{take}", condition, f"test{condition}_s{session}", 0.005)
        for condition, count in sessions.items()
        for session in range(count)
        for take in range(recordings)
    ]


ONE_NAME = [replace(entry, session=entry.session[6:]) for entry in campaign({"1": 3, "2": 3})]
CAMPAIGNS = st.dictionaries(st.sampled_from("1234"), st.integers(5, 9), min_size=1)
SEEDS = st.integers(0, 2**31 - 1)


@given(CAMPAIGNS, st.integers(1, 2), st.integers(0, 1), SEEDS, st.randoms())
def test_sessions_stay_whole_and_every_role_has_every_condition(
    sessions: dict[str, int], tests: int, calibrations: int, seed: int, shuffle: Random
) -> None:
    metadata = campaign(sessions)
    split = split_sessions(metadata, tests, 1, seed, calibrations)
    by_name = {entry.name: entry for entry in metadata}
    assert sorted(name for names in split.values() for name in names) == sorted(by_name)
    roles_of: dict[str, set[str]] = {}
    for role, names in split.items():
        assert {by_name[name].condition for name in names} == (set(sessions) if names else set())
        for name in names:
            roles_of.setdefault(by_name[name].session, set()).add(role)
    assert all(len(roles) == 1 for roles in roles_of.values())
    for condition in sessions:
        own = {role: [by_name[name] for name in names] for role, names in split.items()}
        counts = {role: len({each.session for each in own[role] if each.condition == condition}) for role in own}
        assert (counts["test"], counts["validation"], counts["calibration"]) == (tests, 1, calibrations)
        assert counts["train"] >= 1
    shuffle.shuffle(metadata)
    assert split_sessions(metadata, tests, 1, seed, calibrations) == split


@given(CAMPAIGNS, SEEDS, st.data())
def test_recording_more_in_a_session_moves_no_other(sessions: dict[str, int], seed: int, data: st.DataObject) -> None:
    metadata = campaign(sessions)
    before = split_sessions(metadata, 1, 1, seed)
    beside = data.draw(st.sampled_from(metadata))
    after = split_sessions([*metadata, replace(beside, name="one more")], 1, 1, seed)
    for role in ROLES:
        assert set(after[role]) - {"one more"} == set(before[role])
        assert ("one more" in after[role]) == (beside.name in before[role])


def test_a_draw_is_the_same_everywhere_and_another_with_another_seed() -> None:
    assert split_sessions(campaign({"1": 4, "2": 4}, 1), 1, 1, 1)["test"] == ("test1_s1_r0", "test2_s2_r0")
    assert len({split_sessions(campaign({"1": 8}), 1, 1, seed)["test"] for seed in range(20)}) > 3


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ([], "nothing to split, got no recording"),
        (campaign({"1": 3, "2": 2}), r"condition '2' has 2 sessions \(test2_s0, test2_s1\), but 3 are needed: 1 for"),
        (campaign({"1": 3}) + campaign({"1": 1}), "recording 'test1_s0_r0' occurs twice"),
        (ONE_NAME, "session 's0' occurs in condition '1' and in condition '2' .* make ingest.name_pattern's session"),
    ],
)
def test_what_cannot_be_split_is_refused(metadata: list[RecordingMetadata], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        split_sessions(metadata, 1, 1, 1)


def test_sessions_held_out_by_name_take_the_place_of_drawn_ones() -> None:
    metadata = campaign({"1": 4, "2": 5}, 1)
    named = ["test1_s2", "test1_s3"]
    split = split_sessions(metadata, 1, 1, 7, held_out=named)
    assert {name for name in split["test"] if name.startswith("test1")} == {f"{name}_r0" for name in named}
    assert sum(name.startswith("test2") for name in split["test"]) == 1
    drawn = split_sessions(metadata, 1, 1, 7)
    validation = [[name for name in each["validation"] if "2_s" in name] for each in (split, drawn)]
    assert validation[0] == validation[1]
    with pytest.raises(RecordingError, match=r"split\.held_out names session 'monday', which is not there"):
        split_sessions(metadata, 1, 1, 7, held_out=["monday"])
    with pytest.raises(ValueError, match="1 test, 0 validation and 0 calibration sessions, but got 0, 1 and 0"):
        split_sessions(metadata, 0, 1, 7)
    with pytest.raises(RecordingError, match=r"'1' has 4 sessions .*, but 5 are needed: 3 for test"):
        split_sessions(metadata, 1, 1, 7, held_out=[*named, "test1_s0"])
