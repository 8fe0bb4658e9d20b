"""Files become recordings; a damaged one says why it is repaired or refused, and never stops the good ones."""

from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.conversion import overlaps_in_words
from cylinder_friction.recordings.logs import NameRules, Recipe
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.reading_logs import Ingested, ingest_folder
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.recordings.storage import read_stored
from logger_files import STATED, write_log

PATTERN = r"(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_[^/]*\.csv$"


Ingest = Callable[..., Ingested]


@pytest.fixture
def source(tmp_path: Path, labelled_recordings: list[Recording]) -> Path:
    for number, recording in enumerate(labelled_recordings[:3]):
        write_log(tmp_path / f"raw/condition1_session0{number}_recording01.csv", recording)
    return tmp_path / "raw"


@pytest.fixture
def ingest(source: Path, tmp_path: Path, cylinder: Cylinder) -> Ingest:
    channels = {name: ChannelMapping.from_dict(entry) for name, entry in STATED.items()}
    recipe = Recipe(NameRules(PATTERN), channels, CheckLimits(cylinder))

    def ingest(pattern: str = "*.csv") -> Ingested:
        return ingest_folder(source, pattern, recipe, tmp_path / "out", tmp_path / "out.json")

    return ingest


def test_two_files_of_one_name(ingest: Ingest, source: Path, labelled_recordings: list[Recording]) -> None:
    write_log(source / "x/condition1_session00_recording01.csv", labelled_recordings[4])
    write_log(source / "x-condition1_session00_recording01.csv", labelled_recordings[5])
    result = ingest("**/*.csv")
    (entry,) = result.quarantined
    assert entry.file == "x-condition1_session00_recording01.csv"
    assert "has the name 'x-condition1_session00_recording01', which x/condition1_session00" in entry.reason


def test_nothing_usable_is_an_error_and_leaves_the_old_output(ingest: Ingest, source: Path, tmp_path: Path) -> None:
    ingest()
    for path in source.glob("*.csv"):
        path.write_text("a\n1\n")
    with pytest.raises(RecordingError, match=r"no file is usable \(of 3\); the first, condition1_session00_.*csv: "):
        ingest()
    assert len(read_stored(tmp_path / "out")) == 3
    with pytest.raises(RecordingError, match=r"no file matches '\*.tdms'; put recordings there, or name their folder"):
        ingest("*.tdms")


def test_files_that_the_pattern_leaves_out_are_said(ingest: Ingest, source: Path) -> None:
    (source / "condition1_session07_recording01.CSV").write_text("a\n1\n")
    (source / ".gitignore").write_text("/x\n")
    result = ingest()
    assert result.notes == [
        "1 file not read, for '*.csv' does not match (first: condition1_session07_recording01.CSV); see ingest.pattern"
    ]


Damage = Callable[[pd.DataFrame, str], pd.DataFrame | str]
FIRST, DAMAGED = "condition1_session00_recording01", "condition1_session09_recording01"


def in_psi(first: str) -> pd.DataFrame:
    """Return a log whose pressures were converted to psi and back, and differ in their last digits."""
    return pd.read_csv(StringIO(first)).assign(p1=lambda log: log["p1"] / 14.503774 * 14.503774)


DAMAGES: dict[str, tuple[Damage, list[str], str]] = {
    "cut in the last number": (lambda log, _: log.to_csv(index=False)[:-3], [""], "last line"),
    "a second lost": (lambda log, _: log.drop(index=range(2000, 2200)), ["_part1", "_part2"], "split at 1 gap of mor"),
    "a new rate": (lambda log, _: log[(log.index < 2000) | (log.index % 5 == 0)], [""], "left out between gaps:"),
    "empty": (lambda *_: "", [], "is empty"),
    "another rate": (lambda log, _: log.iloc[::2], [], "sample time of 0.01 s"),
    "the same samples": (lambda _, first: first.replace(",", ";"), [], "holds the same samples as"),
    "the same in psi": (lambda _, first: in_psi(first), [], f"samples as recording '{FIRST}' of {FIRST}.csv; a copy"),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_file_is_repaired_or_refused_beside_good_ones(
    ingest: Ingest, name: str, source: Path, tmp_path: Path, labelled_recordings: list[Recording]
) -> None:
    damage, parts, says = DAMAGES[name]
    log = pd.read_csv(write_log(tmp_path / "fourth.csv", labelled_recordings[3]))
    good = sorted(path.stem for path in source.iterdir())
    first = (source / f"{good[0]}.csv").read_text(encoding="utf-8")
    damaged = damage(log, first)
    text = damaged if isinstance(damaged, str) else damaged.to_csv(index=False)
    (source / f"{DAMAGED}.csv").write_text(text, encoding="utf-8")
    result = ingest()
    stored = read_stored(tmp_path / "out")
    assert [each.name for each in stored] == [*good, *(f"{DAMAGED}{part}" for part in parts)]
    assert all(each.metadata.repairs == () for each in stored[:3])
    assert [each.metadata.source_file for each in stored[:3]] == [f"{name}.csv" for name in good]
    assert all(says in " ".join(each.metadata.repairs) for each in stored[3:])
    reasons = [entry["reason"] for entry in read_json(tmp_path / "out.json")]
    assert len(reasons) == (not parts or name == "a new rate")
    assert all(says in reason for reason in reasons)
    assert says in result.summary()


@pytest.mark.parametrize(
    ("starts", "session", "words"),
    [
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:04.000"), "monday", "a and b by 6 s; if they are of the same"),
        (("2026-03-14T08:15:04.000", "2026-03-14T08:15:00.000"), "monday", "b and a by 6 s"),
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:10.000"), "monday", ""),
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:09.000"), "monday", ""),  # starts are rounded
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:04.000Z"), "monday", ""),  # two clocks
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:04.000"), "tuesday", ""),
        (("2026-03-14", "2026-03-14"), "monday", ""),
    ],
)
def test_overlapping_recordings_of_a_session_are_named(starts: tuple[str, str], session: str, words: str) -> None:
    given = zip("ab", ("monday", session), starts, strict=True)
    named = overlaps_in_words((RecordingMetadata(a, "1", b, 0.005, start=start), 10.0) for a, b, start in given)
    assert (words in named) if words else named == ""
