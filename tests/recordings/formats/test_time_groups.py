"""Files with several time columns of one name; their layouts are those of real exports, their numbers made up here."""

import re
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.recordings.formats.format import CsvOptions, LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError

FAST = [[0, 0, 10], [5, 1, 11], [10, 2, 12], [15, 3, 13], [20, 4, 14], [25, 5, 15]]
SLOW = [[0, 0.5], [10, 1.5], [20, 2.5]]
BANNER = "Name;Press;\nFile;D:\\a.csv;\nStarttime of export;134179488000000000;14. March 2026;08:00:00.000\n\n\n"
METADATA = (
    "SymbolComment;;piston (* of\nthe press *);SymbolComment;\nData-Type;REAL64;REAL64;Data-Type;REAL64\n"
    "SampleTime[ms];5;5;SampleTime[ms];10\nOffset;0;0;Offset;0\nScaleFactor;1;1;ScaleFactor;1\n"
    "Unit;bar (Pressure);(None);Unit;m (Length)\nUnit ScaleFactor;1;1;Unit ScaleFactor;1\n"
)


@pytest.fixture
def read(tmp_path: Path):  # type: ignore[no-untyped-def]
    def written(content: str | bytes, wanted: list[str] | None = None, **options: str) -> list[LoggedTable]:
        path = tmp_path / "log.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_logged_file(path, CsvOptions(**options), wanted)

    return written


def rows(padding: str = "", slow_first: bool = False) -> str:
    """Return rows; padding stands in the cells of the group that has ended, or nothing where it is 'short'."""
    lines = []
    for index, fast in enumerate(FAST):
        slow = SLOW[index] if index < len(SLOW) else [padding, padding]
        cells = [*slow, *fast] if slow_first else [*fast, *([] if slow == ["short"] * 2 else slow)]
        lines.append(";".join(map(str, cells)))
    return "\n".join(lines) + "\n"


HEADER = "Name;p1;p2;Name;x\n"

FILES = {
    "empty cells": BANNER + HEADER + "\n" + rows(),
    "EOF in the columns that end": HEADER + rows("EOF"),
    "shorter rows": BANNER + HEADER + "\n" + rows("short"),
    "EOF in every cell, no line end": BANNER + HEADER + "\n" + rows() + "EOF;EOF;EOF;EOF;EOF",
    "all that the scope knows": BANNER + HEADER + METADATA + "\n" + rows("short"),
    "tabs and decimal commas": (BANNER + HEADER + "\n" + rows("short")).replace(".", ",").replace(";", "\t"),
    "each value where it was sampled": HEADER
    + "\n".join(
        f"{a};{b};{c};" + (f"{SLOW[i // 2][0]};{SLOW[i // 2][1]}" if i % 2 == 0 else ";")
        for i, (a, b, c) in enumerate(FAST)
    )
    + "\n",
}


@pytest.mark.parametrize("content", FILES.values(), ids=FILES)
def test_each_time_column_stamps_the_channels_behind_it(read, content: str | bytes) -> None:  # type: ignore[no-untyped-def]
    fast, slow = read(content)
    assert (fast.name, slow.name) == ("group 1", "group 2")
    assert list(fast.channels) == ["Name", "p1", "p2"]
    assert list(slow.channels) == ["Name", "x"]
    np.testing.assert_array_equal(fast.channels.to_numpy(np.float64), FAST)
    np.testing.assert_array_equal(slow.channels.to_numpy(np.float64), SLOW)


def test_a_slower_group_may_come_first_and_only_some_channels_be_asked_for(read) -> None:  # type: ignore[no-untyped-def]
    text = BANNER + "Name;x;Name;p1;p2\n\n" + rows(" ", slow_first=True)
    slow, fast = read(text, ["Name", "p2"])
    assert (list(slow.channels), list(fast.channels)) == (["Name"], ["Name", "p2"])
    assert slow.unread == ("x", "p1")
    assert fast.channels["p2"].tolist() == [10, 11, 12, 13, 14, 15]
    without_time = read(text, ["x", "p1"])
    assert [len(table.channels) for table in without_time] == [3, 6]


def test_the_scope_counts_milliseconds_and_states_units(read) -> None:  # type: ignore[no-untyped-def]
    fast, _ = read(BANNER + HEADER + METADATA + "\n" + rows())
    assert fast.units == {"Name": "ms", "p1": "bar", "x": "m"}
    assert read(BANNER + HEADER + "\n" + rows())[0].units == {"Name": "ms"}
    assert read(HEADER + rows())[0].units == {}
    (one,) = read(BANNER + "Name;p1;p2\nUnit;bar;bar\n\n0;1;2\n5;3;4\nEOF\n")
    assert one.units == {"Name": "ms", "p1": "bar", "p2": "bar"}
    assert one.channels.to_dict("list") == {"Name": [0, 5], "p1": [1, 3], "p2": [2, 4]}


DAQ = (  # DAQExpress
    "Timestamp;2026-03-14 08:15:00;Timestamp;2026-03-14 08:15:00\nInterval;0.005;Interval;0.005\n"
    'Channel name;"Piston pressure";Channel name;"Position"\nUnit;"bar";Unit;"mm"'
)


@pytest.mark.parametrize(
    ("header", "one", "other", "units"),
    [
        ("t [s];P [bar];t [s];x [m]", "t [s];P [bar]", "t [s];x [m]", {"t [s]": "s", "P [bar]": "bar", "x [m]": "m"}),
        ("X_Value;p;X_Value;x;Comment", "X_Value;p", "X_Value;x", {}),
        ("Nr;Time;p;Time;x", "Nr;Time;p", "Time;x", {}),
        (DAQ, "Channel name;Piston pressure", "Channel name;Position", {"Piston pressure": "bar", "Position": "mm"}),
    ],
)
def test_time_columns_may_have_any_name_that_comes_again(  # type: ignore[no-untyped-def]
    read, header: str, one: str, other: str, units: dict[str, str]
) -> None:
    row = "{0};{1};2;{1};3\n" if header.startswith("Nr") else "{1};2;{1};3\n"
    first, second = read(header + "\n" + "".join(row.format(i, 5 * i) for i in range(40)))
    assert (";".join(first.channels), ";".join(list(second.channels)[:2])) == (one, other)
    assert first.units == units


def test_channels_that_end_before_the_others_are_used_as_far_as_they_go(read) -> None:  # type: ignore[no-untyped-def]
    (table,) = read(BANNER + "Name;p1;x\n\n" + "0;5.01;0.7\n" * 3 + "10;5.02\n")
    assert table.channels["p1"].tolist() == [5.01, 5.01, 5.01, 5.02]
    np.testing.assert_array_equal(table.channels["x"], [0.7, 0.7, 0.7, np.nan])


SHORT = HEADER + rows("short").replace("5;1;11;10;1.5", "5;1")
BLANKS = HEADER.replace(";", " ") + "0 1 2 0 3\n" * 60 + "60 1 2\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (SHORT, "line 3 holds 2 instead of 5 values: '5;1'; correct"),
        (BLANKS, "holds 3 instead of 5 values: '60 1 2'"),
        (BANNER + "Name;p1;x\n\n" + "0;1;2\n" * 40 + "5;1\n10;1;2\n", "line 48 holds 2 instead of 3 values: '5;1'"),
    ],
    ids=["above longer ones", "between blanks", "a whole row behind"],
)
def test_short_rows_that_may_mean_something_else_are_refused(read, content: str, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(RecordingError, match=re.escape(words)):
        read(content)
