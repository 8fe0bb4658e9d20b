from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.conversion import Recipe
from cylinder_friction.recordings.files import read_json
from cylinder_friction.recordings.ingesting import Ingested, Source, ingest_folder
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.path_names import NameRules
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_stored
from logger_files import CHANNELS, write_log

LIMITS = CheckLimits(stroke_m=0.25)


@pytest.fixture
def source(tmp_path: Path, labelled_recordings: list[Recording]) -> Source:
    folder = tmp_path / "raw"
    for number, recording in enumerate(labelled_recordings[:3]):
        write_log(folder / f"condition1_session0{number}_recording01.csv", recording)
    return Source(
        folder,
        "*.csv",
        Recipe(
            NameRules(r"(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_[^/]*\.csv$"),
            {column: ChannelMapping.from_dict(entry) for column, entry in CHANNELS.items()},
            "made",
            LIMITS,
        ),
    )


def ingest(source: Source, into: Path) -> Ingested:
    return ingest_folder(source, into, into.with_name(f"{into.name}.json"))


def test_good_files_become_recordings(source: Source, tmp_path: Path, labelled_recordings: list[Recording]) -> None:
    result = ingest(source, tmp_path / "out")
    recordings = read_stored(tmp_path / "out")
    assert [recording.name for recording in recordings] == [f"condition1_session0{n}_recording01" for n in range(3)]
    assert result.quarantined == []
    assert read_json(tmp_path / "out.json") == []
    for recording, original in zip(recordings, labelled_recordings, strict=False):
        np.testing.assert_allclose(recording.samples(), original.samples(), rtol=1e-12)
        assert recording.metadata.source_file == f"{recording.name}.csv"
        assert len(recording.metadata.source_sha256) == 64
        assert recording.sample_time_s == 0.005


def test_two_files_of_one_name(source: Source, tmp_path: Path, labelled_recordings: list[Recording]) -> None:
    write_log(source.folder / "x/condition1_session00_recording01.csv", labelled_recordings[4])
    write_log(source.folder / "x-condition1_session00_recording01.csv", labelled_recordings[5])
    result = ingest(replace(source, pattern="**/*.csv"), tmp_path / "out")
    (entry,) = result.quarantined
    assert entry.file == "x-condition1_session00_recording01.csv"
    assert "has the name 'x-condition1_session00_recording01', which x/condition1_session00" in entry.reason


def test_nothing_usable_is_an_error_and_leaves_the_old_output(source: Source, tmp_path: Path) -> None:
    ingest(source, tmp_path / "out")
    for path in source.folder.glob("*.csv"):
        path.write_text("a\n1\n")
    with pytest.raises(RecordingError, match=r"none of 3 files is usable; the first, condition1_session00_.*csv: "):
        ingest(source, tmp_path / "out")
    assert len(read_stored(tmp_path / "out")) == 3


def test_empty_folder_says_what_to_do(source: Source, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no file matches '\*.tdms'; put recordings there, or name their folder"):
        ingest(replace(source, pattern="*.tdms"), tmp_path / "out")


def test_equal_input_gives_equal_bytes(source: Source, tmp_path: Path) -> None:
    for name in ("a", "b"):
        ingest(source, tmp_path / name)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_files_that_the_pattern_leaves_out_are_said(source: Source, tmp_path: Path) -> None:
    (source.folder / "condition1_session07_recording01.CSV").write_text("a\n1\n")
    (source.folder / ".gitignore").write_text("/x\n")
    result = ingest(source, tmp_path / "out")
    assert result.notes == [
        "1 file not read, for '*.csv' does not match (first: condition1_session07_recording01.CSV); see ingest.pattern"
    ]


def test_a_table_of_names_is_no_recording_although_the_pattern_matches_it(source: Source, tmp_path: Path) -> None:
    table = source.folder / "names.csv"
    table.write_text("file,condition,session\n*00_*,1,a\n*01_*,2,b\n*02_*,2,c\n")
    result = ingest(replace(source, recipe=replace(source.recipe, names=NameRules(table=table))), tmp_path / "out")
    assert (result.files, result.quarantined, result.notes) == (3, [], [])
    assert [metadata.condition for metadata, _ in result.recordings] == ["1", "2", "2"]
