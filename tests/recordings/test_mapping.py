from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.recordings import ChannelMapping, RecordingError
from cylinder_friction.recordings.mapping import apply_mapping, check_mapping, compile_name_pattern, names_from_path

MAPPING = {
    "time_s": ChannelMapping("t", "ms"),
    "pressure_1_pa": ChannelMapping("a", "bar"),
    "pressure_2_pa": ChannelMapping("b", "psi"),
    "position_m": ChannelMapping("x", "mm", -1),
}


def channels(**columns: list[object]) -> pd.DataFrame:
    return pd.DataFrame({"t": [0, 5], "a": [1.0, 2.0], "b": [0.0, 1.0], "x": [-10.0, -20.0], "spare": [0, 0]} | columns)


def test_units_and_signs_are_applied_and_spare_channels_left_out() -> None:
    table = apply_mapping(channels(), MAPPING)
    assert list(table.columns) == list(MAPPING)
    np.testing.assert_allclose(table["time_s"], [0.0, 0.005])
    np.testing.assert_allclose(table["pressure_1_pa"], [1e5, 2e5])
    np.testing.assert_allclose(table["position_m"], [0.01, 0.02])


def test_missing_channel_names_what_there_is() -> None:
    with pytest.raises(RecordingError, match=r"'b' \(for 'pressure_2_pa'\) is missing; got channels 't', 'a', 'x'"):
        apply_mapping(channels().drop(columns=["b", "spare"]), MAPPING)


def test_channel_that_occurs_twice_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"'a' .* occurs 2 times"):
        apply_mapping(pd.concat([channels(), channels()[["a"]]], axis=1), MAPPING)


def test_text_is_refused_with_its_row() -> None:
    with pytest.raises(RecordingError, match=r"'a' .* holds 'open' in row 2 \(1 such rows in all\); .* numbers in bar"):
        apply_mapping(channels(a=["1.0", "open"]), MAPPING)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pressure_3_pa": ChannelMapping("c", "bar")}, "'pressure_3_pa' is not known; expected some of time_s"),
        ({"pressure_2_pa": ChannelMapping("a", "bar")}, "'a' is to fill both 'pressure_1_pa' and 'pressure_2_pa'"),
        ({"position_m": ChannelMapping("x", "mm", 2)}, "'position_m': sign must be 1 or -1, but got 2"),
        ({"position_m": ChannelMapping("x", "cm")}, "unit 'cm' is not known"),
    ],
)
def test_wrong_mapping_is_refused(change: dict[str, ChannelMapping], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        check_mapping(MAPPING | change)


def test_mapping_without_position_is_refused() -> None:
    with pytest.raises(RecordingError, match="'position_m' has no channel"):
        check_mapping({column: source for column, source in MAPPING.items() if column != "position_m"})


RIG = r"(?P<session>test(?P<test>[^_/]+)_session[^_/]+)_[^/]*\.csv$"


@given(st.integers(1, 9), st.integers(1, 99), st.integers(1, 99))
def test_names_of_the_rig(test: int, session: int, recording: int) -> None:
    path = f"test{test}_session{session:02d}_recording{recording:02d}.csv"
    names = names_from_path(path, compile_name_pattern(RIG))
    assert (names.name, names.test, names.session) == (path[:-4], str(test), f"test{test}_session{session:02d}")
    assert names.load == ""


def test_folders_become_part_of_the_name_and_load_is_read() -> None:
    pattern = compile_name_pattern(r"^(?P<session>(?P<test>\w+)_\d+)/(?P<load>\d+kg)")
    names = names_from_path("crane_3/20kg.part.csv", pattern)
    assert (names.name, names.test, names.session, names.load) == ("crane_3-20kg.part", "crane", "crane_3", "20kg")


def test_path_that_tells_nothing_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"path 'notes.csv' does not tell test and session"):
        names_from_path("notes.csv", compile_name_pattern(RIG))


@pytest.mark.parametrize(
    ("pattern", "message"),
    [("(?P<test>a)(", "is not a regular expression"), ("(?P<test>a)", "has no group 'session'")],
)
def test_wrong_pattern_is_refused(pattern: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        compile_name_pattern(pattern)
