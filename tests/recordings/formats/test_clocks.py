"""Dates, times of day, clocks that two columns make, numbers that are dates, and rows that come newest first."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.formats.cells import EPOCHS, epoch_of
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file

ROWS = 40
STEPS_NS = 50_000_000 * np.arange(ROWS)
BEGIN = np.datetime64("2026-03-14T08:15:00", "ns")
STAMPS = BEGIN + STEPS_NS.astype("timedelta64[ns]")


def read(folder: Path, header: str, rows: list[str], wanted: list[str] | None = None) -> LoggedTable:
    (folder / "log.csv").write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    (table,) = read_logged_file(folder / "log.csv", wanted=wanted)
    return table


def times(folder: Path, cells: list[str]) -> LoggedTable:
    return read(folder, "Zeit;p", [f"{cell};1" for cell in cells])


def written(form: str) -> list[str]:
    return [
        pd.Timestamp(stamp).strftime(form).format(s=int(stamp) // 10**9, ms=int(step) // 10**6 % 1000, row=row)
        for row, (stamp, step) in enumerate(zip(STAMPS, STEPS_NS, strict=True))
    ]


@pytest.mark.parametrize(
    ("header", "form", "clock"),
    [
        ("Date,Time,p", "%Y/%m/%d,%H:%M:%S.{ms:03d},1.5", "Time"),
        ("Date,Time,p", "%Y/%m/%d,%H:%M:%S;{ms:03d},1.5", "Time"),
        ("Date,Time,p", "%m/%d/%Y,%I:%M:%S.{ms:03d} %p,1.5", "Time"),
        ("Datum;Uhrzeit;p", "%d.%m.%Y;%H:%M:%S,{ms:03d};1,5", "Uhrzeit"),
        ("Date,Time,Millitm,p", "%m/%d/%Y,%H:%M:%S,{ms},1.5", "Time"),
        ("unix_s,ms,p", "{s},{ms},1.5", "unix_s"),
        ("stamp.sec,stamp.nanosec,p", "{s},{ms}000000,1.5", "stamp.sec"),
        ("Number,Date&Time,Microseconds,p", "7,%Y/%m/%d %H:%M:%S,{ms}000,1.5", "Date&Time"),
    ],
)
@pytest.mark.parametrize("all_wanted", [True, False])
def test_two_columns_of_one_stamp_are_joined(
    tmp_path: Path, header: str, form: str, clock: str, all_wanted: bool
) -> None:
    table = read(tmp_path, header, written(form), None if all_wanted else [clock, "p"])
    np.testing.assert_array_equal(table.channels[clock].to_numpy(), STAMPS)
    assert [name for name in table.channels if name in ("Date", "Datum", "Millitm", "Microseconds")] == []
    assert table.channels["p"].tolist() == [1.5] * ROWS
    if header.startswith("Date,"):
        table = read(tmp_path, header, written(form), ["Date", "p"])
        np.testing.assert_array_equal(table.channels["Date"].to_numpy(), STAMPS)


def test_seconds_without_a_unit_are_joined_if_they_step_where_their_part_begins_anew(tmp_path: Path) -> None:
    cells = [f"{55 + row // 20},{row % 20 * 50},1" for row in range(ROWS)]
    table = read(tmp_path, "Time,ms,p", cells)
    np.testing.assert_allclose(table.channels["Time"], 55.0 + 0.05 * np.arange(ROWS))
    assert table.units["Time"] == "s"
    assert read(tmp_path, "Time,ms,p", cells[3:] + cells[:3]).units == {}


COUNTED = {
    "ticks of 100 ns since 1601 (FILETIME)": True,
    "ticks of 100 ns since the year 1 (.NET)": False,
    "days since 30 December 1899 (Excel)": False,
    "days since the year 0 (MATLAB)": False,
    "s since 1904 (LabVIEW)": True,
    **dict.fromkeys(("s since 1970", "ms since 1970", "us since 1970", "ns since 1970"), True),
}


@pytest.mark.parametrize(("epoch", "words"), list(zip(EPOCHS, COUNTED, strict=True)), ids=COUNTED)
def test_numbers_since_a_known_date_are_dates(tmp_path: Path, epoch: Any, words: str) -> None:
    of_1970_ns = STAMPS.astype(np.int64)
    numbers = epoch.of_1970 + (of_1970_ns / epoch.unit_ns if epoch.unit_ns > 100 else of_1970_ns // epoch.unit_ns)
    table = read(tmp_path, "stamp,p", [f"{number!r},1" for number in numbers.tolist()])
    assert (table.notes, table.utc) == ((f"time: 'stamp' counts {words}",), COUNTED[words])
    late_ns = np.abs((table.channels["stamp"].to_numpy() - STAMPS).astype(np.int64))
    assert late_ns.max() <= 2e-16 * numbers.max() * epoch.unit_ns


@pytest.mark.parametrize(
    "numbers",
    [
        46_000.0 + 0.0005 * np.arange(ROWS),  # seconds since midnight, not days
        46_000.0 + np.sin(np.arange(ROWS)),
        1.9e9 + 0.005 * np.arange(ROWS),  # a date in the future
        0.005 * np.arange(ROWS),
    ],
)
def test_other_numbers_are_no_dates(numbers: Any) -> None:
    assert epoch_of(numbers) is None


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S.{ms:03d},1.5", "{row},1.5"])
def test_rows_that_come_newest_first_are_turned_round(tmp_path: Path, form: str) -> None:
    rows = written(form)
    table, forward = (read(tmp_path, "Time,p", each) for each in (rows[::-1], rows))
    assert table.notes == ("its newest row comes first; turned round",)
    pd.testing.assert_frame_equal(table.channels, forward.channels)
    countdown = [f"{row},{ROWS - row},1" for row in range(ROWS)]
    assert read(tmp_path, "Time,Time left,p", countdown).channels["Time"].tolist() == list(range(ROWS))


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (
            ["2026-03-14T08:15:00.125", "2026/03/14 08:15:01:005"],
            ["2026-03-14T08:15:00.125", "2026-03-14T08:15:01.005"],
        ),
        (["20260314T081500,125", "20260314T081501"], ["2026-03-14T08:15:00.125", "2026-03-14T08:15:01"]),
        (["20260314081500125", "20260314081501000"], ["2026-03-14T08:15:00.125", "2026-03-14T08:15:01"]),
        (["20260314_081500", "20260314 081501125"], ["2026-03-14T08:15:00", "2026-03-14T08:15:01.125"]),
        (["14.03.2026 08:15:00,125", "14.03.2026 08:15:00,13"], ["2026-03-14T08:15:00.125", "2026-03-14T08:15:00.130"]),
        (["01.02.2026 08:15", "1.2.2026 08:16"], ["2026-02-01T08:15", "2026-02-01T08:16"]),
        (["14-Mar-2026 08:15:00", "14 Mar 26 08:15:01"], ["2026-03-14T08:15:00", "2026-03-14T08:15:01"]),
        (["03/04/2026 12:00:00 AM", "03/04/2026 1:00:00 PM"], ["2026-03-04T00:00:00", "2026-03-04T13:00:00"]),
        (["2026-03-14 08:15:00 UTC+1", "2026-03-14 08:15:01 UTC"], ["2026-03-14T07:15:00", "2026-03-14T08:15:01"]),
        (["14.03.2026 08:15:00+01:00", "14.03.2026 08:15:01Z"], ["2026-03-14T07:15:00", "2026-03-14T08:15:01"]),
        (["2026-03-14 08:15:00 CET", "2026-03-14 08:15:01 CET"], ["2026-03-14T08:15:00", "2026-03-14T08:15:01"]),
        (["2026-03-14", "2026-03-15"], ["2026-03-14", "2026-03-15"]),
        (["14.03.2026 08:15:00", "NaN", "14.03.2026 08:15"], ["2026-03-14T08:15:00", "NaT", "2026-03-14T08:15"]),
        (["28/02/2026 23:59:59", "01/03/2026 00:00:00"], ["2026-02-28T23:59:59", "2026-03-01T00:00:00"]),
        (["02/28/2026 23:59:59", "03/01/2026 00:00:00"], ["2026-02-28T23:59:59", "2026-03-01T00:00:00"]),
        (["23:59:59.5", "00:00:00.5"], ["2026-03-14T23:59:59.5", "2026-03-15T00:00:00.5"]),
        (["59:59.5", "00:00.5"], ["2026-03-14T23:59:59.5", "2026-03-15T00:00:00.5"]),
    ],
)
def test_dates(tmp_path: Path, cells: list[str], expected: list[str]) -> None:
    stamps = read(tmp_path, "Start: 2026-03-14 23:59:58\nZeit;p", [f"{c};1" for c in cells]).channels["Zeit"].to_numpy()
    assert stamps.dtype == np.dtype("datetime64[ns]")
    np.testing.assert_array_equal(stamps, np.array(expected, dtype="datetime64[ns]"))


@pytest.mark.parametrize(
    ("cells", "unit", "expected"),
    [
        (["08:15:00,125", "08:15:01"], "s", [29700.125, 29701.0]),
        (["08:15:00.5 PM", "12:15:00 am"], "s", [72900.5, 900.0]),
        (["15:00.1", "15:00.2"], "s", [900.1, 900.2]),
        (["01/02/2026 08:00:00", "01/02/2026 08:00:01"], "s", [28800.0, 28801.0]),
        *[([f"{day} 08:00:00"] * 2, "s", [28800.0] * 2) for day in ("23-03-14", "14/03/26", "'26.03.14")],
        (["0 sec", "0.005 sec"], "sec", [0.0, 0.005]),
    ],
)
def test_a_time_of_day_counts_from_midnight(tmp_path: Path, cells: list[str], unit: str, expected: list[float]) -> None:
    """A duration states its own unit. A date that may begin with the day or not is left out, with a note."""
    table = times(tmp_path, cells)
    assert table.units == {"Zeit": unit}
    first = "month" if "2026" in cells[0] else "year"
    assert [f"the day or the {first} first" in note for note in table.notes] == [True] * (len(cells[0]) > 15)
    np.testing.assert_allclose(table.channels["Zeit"], expected, rtol=1e-15)


@pytest.mark.parametrize("cell", ["31.02.2026 08:15:00", "14.03.2026 08:15:00 CEST"])
def test_what_is_no_date_stays_text(tmp_path: Path, cell: str) -> None:
    assert times(tmp_path, ["14.03.2026 08:15:00", cell]).channels["Zeit"].tolist() == ["14.03.2026 08:15:00", cell]
