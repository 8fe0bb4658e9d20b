"""Who and when a recording is: named by its file's path, dated by its header or its stamps."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.conversion import recordings_of
from cylinder_friction.recordings.formats.cells import start_in_header
from cylinder_friction.recordings.logs import NameRules, StartRules, find_logs
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata, Start
from logger_files import CHANNELS, made_log

FOLDERS = r"^(?P<session>(?P<condition>\w+)_\d+)/(?P<load>\d+kg)"


@pytest.mark.parametrize(
    ("pattern", "path", "expected"),
    [
        (r"(?P<session>_\d{6})\.", "Jib_230425.csv.gz", ("Jib_230425.csv", "1", "_230425", "")),
        (FOLDERS, "crane_3/20kg.part.csv", ("crane_3-20kg.part", "crane", "crane_3", "20kg")),
    ],
)
def test_a_pattern_reads_names(pattern: str, path: str, expected: tuple[str, str, str, str]) -> None:
    assert NameRules(pattern).names(path) == RecordingMetadata(*expected[:3], ANY, load=expected[3])
    with pytest.raises(RecordingError, match=r"path 'notes.csv' does not give condition and session"):
        NameRules(pattern).names("notes.csv")


@pytest.mark.parametrize("path", ["back\\slash.csv", "new\nline.csv", "day/bytes\udcff.csv"])
def test_a_name_that_other_systems_cannot_have_is_refused(path: str) -> None:
    with pytest.raises(RecordingError, match="holds a backslash, a control character or bytes that are not UTF-8"):
        NameRules().names(path)
    assert NameRules().names("Öl\u00a05 °C.csv").name == "Öl\u00a05 °C"


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        (["Starttime of export\t133898780827320000\tonsdag"], "2025-04-23T10:34:42.732Z"),
        (["Date\t2025/04/23", "Time\t10:14:03.1235678"], "2025-04-23T10:14:03.124"),
        (["Messzeit\t0:30", "Datum:\t27.03.2026 00:00:00", "Uhrzeit:\t08:15:00,5"], "2026-03-27T08:15:00.500"),
        (["# Start time: 2026-03-27T10:15:00+01:00"], "2026-03-27T09:15:00.000Z"),
        (["Start time (UTC): 2026-03-27 10:15:00"], "2026-03-27T10:15:00.000Z"),
        (["Recording start = 2026-03-27 10:15:00 UTC-5"], "2026-03-27T15:15:00.000Z"),
        (["Messbeginn\t27.03.2026"], "2026-03-27"),
        (["StartTime=1773480000"], "2026-03-14T09:20:00.000Z"),
        (["T0 = 27.03.2026 08:15:00"], "2026-03-27T08:15:00.000"),
        (["Acquisition: Timed\tTime:\t1.5\tSec\t3/27/2026 8:15:00 AM"], "2026-03-27T08:15:00.000"),
        (["=~=~= PuTTY log 2026.03.27 08:15:00 =~=~="], "2026-03-27T08:15:00.000"),
        (["# Start time: 1773480000500"], "2026-03-14T09:20:00.500Z"),
        (["Start;46095,42708", "Time;1"], "2026-03-14T10:14:59.712"),
        (["StartTime=4773480000", "Start;46095", "Time: 46095.42708"], None),  # in the future; a count; a time
        (["Date: 02/03/2026"], None),  # the day or the month first
        (["Date: 2026-02-31"], None),
        (["Calibration date: 2024-01-01", "Sample time: 0.005"], None),
    ],
)
def test_a_header_states_the_start_or_none(lines: list[str], text: str | None) -> None:
    start = start_in_header(lines)
    assert (start and start.text()) == text


BEGIN, EXPORT = pd.Timestamp("2026-03-27T09:15:00Z"), "Starttime of export,134190764950000000,fredag"


def dated(log: pd.DataFrame, zone: str | None = "UTC") -> pd.DataFrame:
    return log.assign(t=(BEGIN + pd.to_timedelta(log["t"], unit="s")).dt.tz_convert(zone))


def local(log: pd.DataFrame, path: Path) -> None:
    to_csv(dated(log, None), path)


def to_csv(log: pd.DataFrame, path: Path, form: str = "%d.%m.%Y %H:%M:%S.%f") -> None:
    log.to_csv(path, index=False, date_format=form)


def seconds_of_day(log: pd.DataFrame, path: Path) -> None:  # they begin 50 s after the start of the header
    path.write_text("Start: 2026-03-27T10:14:10+01:00\n" + log.assign(t=log["t"] + 36_900.0).to_csv(index=False))


def with_header(log: pd.DataFrame) -> str:
    """Begin the rows 5 s after what the header states."""
    return f"{EXPORT}\n\n" + log.assign(t=log["t"] + 5.0).to_csv(index=False)


UTC, OSLO = "2026-03-27T09:15:00.000Z", "2026-03-27T08:15:00.000Z"
ISO, STAMPS = "%Y-%m-%dT%H:%M:%S.%fZ", "time stamps of 't'"
LOGS: dict[str, tuple[Callable[[pd.DataFrame, Path], Any], str, str, str]] = {
    "dates in UTC": (lambda log, path: to_csv(dated(log), path, ISO), "", UTC, STAMPS),
    "dates without a zone": (local, "", UTC.removesuffix("Z"), STAMPS),
    "dates of a stated zone": (local, "Europe/Oslo", OSLO, f"{STAMPS}, Europe/Oslo"),
    "Parquet": (lambda log, path: dated(log).to_parquet(path), "", UTC, STAMPS),
    "seconds since 1970": (lambda log, path: to_csv(log.assign(t=log["t"] + BEGIN.timestamp()), path), "", UTC, STAMPS),
    "seconds of the day": (seconds_of_day, "", UTC, STAMPS),
    "a header": (lambda log, path: path.write_text(with_header(log)), "", UTC, f"header line {EXPORT!r}"),
    "nothing": (to_csv, "", "", ""),
}


@pytest.mark.parametrize("rows", [None, 1200])
@pytest.mark.parametrize("kind", LOGS)
def test_a_recording_knows_when_it_was_made(tmp_path: Path, cylinder: Cylinder, kind: str, rows: int | None) -> None:
    write, zone, text, source = LOGS[kind]
    rules = {"zone": zone} if zone else {}
    write(made_log(4000), tmp_path / "log")
    time = {"channel": "t"} | ({} if "dates" in kind or kind == "Parquet" else {"unit": "s"})
    logs = find_logs(tmp_path / "log", {"channels": CHANNELS | {"time_s": time}, "start": rules}, cylinder)
    found = list(recordings_of(logs, rows))
    rows_before = 0
    for recording in found:
        assert isinstance(recording, Recording), recording
        start = recording.metadata.start
        assert (bool(start), start.endswith("Z")) == (bool(text), text.endswith("Z"))
        if text:
            since = np.datetime64(start.removesuffix("Z")) - np.datetime64(text.removesuffix("Z"))
            assert abs(since - np.timedelta64(5 * rows_before, "ms")) <= np.timedelta64(1, "ms")
        assert recording.metadata.start_source == source
        rows_before += len(recording)
    assert len(found) == (1 if rows is None else 3)


@pytest.mark.parametrize(
    ("at", "text"),
    [
        ("2026-03-27T10:15:00", "2026-03-27T09:15:00.000Z"),
        ("2026-07-27T10:15:00", "2026-07-27T08:15:00.000Z"),  # summer time
        ("2026-10-25T02:30:00", "2026-10-25T02:30:00.000"),  # this hour was twice
        ("2026-03-29T02:30:00", "2026-03-29T02:30:00.000"),  # this hour never was
    ],
)
def test_a_stated_zone_makes_utc_but_of_an_hour_that_was_twice_or_never(at: str, text: str) -> None:
    start = StartRules("Europe/Oslo").in_utc(Start(np.datetime64(at, "ns"), utc=False, source="header"))
    assert start is not None
    assert start.text() == text
    assert start.source == f"header{', Europe/Oslo' if start.utc else '; in Europe/Oslo that hour was twice or never'}"


PATTERN = r"(?P<day>\d\d)(?P<month>\d\d)(?P<year>\d\d)(?:_(?P<hour>\d\d)(?P<minute>\d\d))?"


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("press_270326_1015", "2026-03-27T09:15:00.000Z"),
        ("press_270326", "2026-03-27"),
        ("press_310226", ""),
        ("press", ""),
    ],
)
def test_a_file_name_states_the_start_if_the_log_does_not(
    tmp_path: Path, cylinder: Cylinder, name: str, start: str
) -> None:
    for file in (name, "z_280326"):
        made_log(4000).to_csv(tmp_path / f"{file}.csv", index=False)
    rules = {"zone": "Europe/Oslo", "pattern": PATTERN}
    settings = {"channels": CHANNELS, "start": rules}
    recording = next(recordings_of(find_logs(tmp_path, settings, cylinder)))
    assert isinstance(recording, Recording), recording
    note = f"start.pattern '{PATTERN}' finds no date in '{name}.csv'; correct it or the name; until then its start is"
    assert (recording.metadata.start, recording.metadata.remarks) == (start, () if start else (f"{note} not known",))
    if not start:
        with pytest.warns(UserWarning, match=r"start\.pattern '\(\?P<day>.*' of the mapping finds nothing in any"):
            find_logs(tmp_path / f"{name}.csv", settings, cylinder)


def test_a_start_in_the_future_is_not_stated(tmp_path: Path, cylinder: Cylinder) -> None:
    log, file = made_log(4000), tmp_path / "press_270326_1015.csv"
    to_csv(log.assign(t=pd.Timestamp("2096-03-14") + pd.to_timedelta(log["t"], unit="s")), file)
    channels = CHANNELS | {"time_s": {"channel": "t"}}
    late = "its clock started in the future, 2096-03-14T00:00:00.000 (time stamps of 't'); its start is unknown"
    for rules, expected in (({}, ("", late)), ({"pattern": PATTERN}, ("2026-03-27T10:15:00.000", "file name"))):
        recording = next(recordings_of(find_logs(file, {"channels": channels, "start": rules}, cylinder)))
        assert isinstance(recording, Recording), recording
        assert (recording.metadata.start, recording.metadata.start_source) == expected
