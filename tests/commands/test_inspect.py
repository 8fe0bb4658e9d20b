"""A first mapping of a logger's file; inspecting files: the checks say what is wrong, the page shows what is there."""

import os
import shutil
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from cylinder_friction.commands.cli import main
from cylinder_friction.commands.inspect import inspect_path
from cylinder_friction.commands.params import compose_params
from cylinder_friction.params.checking import Params, check_params
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.stages import ingest
from cylinder_friction.stages._stage import RECORDINGS_FOLDER
from format_writers import SAMPLES
from packed_pages import unpacked

Damage = Callable[[pd.DataFrame], pd.DataFrame]

CONF = Path(__file__).parents[2] / "conf"
COLUMNS = TIME, P1, P2, POSITION = "Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]"


@cache
def params_for(*overrides: str) -> Params:
    return check_params(compose_params(CONF, ["ingest=rig", *overrides]), "conf")


def sampled(recording: Recording, names: Iterable[str]) -> pd.DataFrame:
    """Return a log in s, bar and mm with columns of these names."""
    columns = recording.table[["time_s", "pressure_1_pa", "pressure_2_pa", "position_m"]]
    return columns.mul([1.0, 1e-5, 1e-5, 1e3]).set_axis(list(names), axis=1)


@pytest.fixture
def log(labelled_recordings: list[Recording]) -> pd.DataFrame:
    return sampled(labelled_recordings[0], COLUMNS)


def write(folder: Path, log: pd.DataFrame, session: int = 1) -> Path:
    path = folder / f"condition1_session{session:02d}_recording01.csv"
    folder.mkdir(exist_ok=True)
    log.assign(**{"Oil temperature [degC]": 37.0}).to_csv(path, index=False)
    return path


def inspected(folder: Path, log: pd.DataFrame, *overrides: str) -> tuple[str, bool, str]:
    """Return what the checks say of a log, whether it is refused, and its page."""
    report, refused = inspect_path(write(folder, log), params_for(*overrides), folder / "page.html")
    return report, refused, unpacked((folder / "page.html").read_text(encoding="utf-8"))


def test_a_name_that_is_no_text_is_escaped_on_the_page(tmp_path: Path, log: pd.DataFrame) -> None:
    path = write(tmp_path, log)
    path = path.rename(tmp_path / os.fsdecode(b"condition1_\xff.csv"))
    report, _ = inspect_path(path, params_for(), tmp_path / "page.html")
    assert "condition1_\\udcff.csv" in report
    assert "condition1_\\udcff.csv" in unpacked((tmp_path / "page.html").read_text(encoding="utf-8"))


def held(log: pd.DataFrame, column: str, first: int, last: int, value: float | None = None) -> pd.DataFrame:
    """Hold a column in the rows at a value, or at that of the first row."""
    values = log[column].to_numpy(copy=True)
    values[first:last] = values[first] if value is None else value
    return log.assign(**{column: values})


def swapped(log: pd.DataFrame) -> pd.DataFrame:
    return log.assign(**{P1: log[P2], P2: log[P1]})


REFUSED: dict[str, tuple[Damage, str]] = {
    "pressure beyond the sensor": (lambda log: held(log, P1, 1000, 1200, 400.0), "file"),
    "position stuck early on": (lambda log: held(log, POSITION, 500, 1100), "position_steps"),
    "too short for the filters": (lambda log: log.iloc[:20], "length"),
    "a few rows": (lambda log: log.iloc[:4], "length"),
}


@pytest.mark.parametrize("name", list(REFUSED))
def test_what_is_refused_is_told_and_shown_all_the_same(tmp_path: Path, log: pd.DataFrame, name: str) -> None:
    damage, check = REFUSED[name]
    report, refused, page = inspected(tmp_path, damage(log))
    assert refused
    assert any(line.split()[:2] == ["refused", check] for line in report.splitlines()), report
    assert '<div class="plot"' in page
    assert "What follows is drawn to show what is wrong, and is no result." in page


@pytest.mark.parametrize("load", ["none", "position"])
@pytest.mark.parametrize("name", ["one direction", "spikes", "noise alone"])
def test_odd_recordings_make_a_page_too(tmp_path: Path, log: pd.DataFrame, name: str, load: str) -> None:
    random = np.random.default_rng(4)
    damages: dict[str, Damage] = {
        "one direction": lambda log: log.assign(**{POSITION: np.linspace(20.0, 230.0, len(log))}),
        "spikes": lambda log: log.assign(**{P1: log[P1] + 100.0 * (np.arange(len(log)) == 77)}),
        "noise alone": lambda log: log.assign(**{POSITION: 120.0 + random.normal(0.0, 2.0, len(log))}),
    }
    report, _, page = inspected(tmp_path, damages[name](log), f"ingest.load={load}")
    assert report.startswith("condition1_session01_recording01.csv")
    assert '<div class="plot"' in page


def test_what_is_no_recording_at_all_has_its_reason_in_the_table(tmp_path: Path, log: pd.DataFrame) -> None:
    report, refused, page = inspected(tmp_path, log.drop(columns=[P2]))
    assert refused
    assert "'P2 [bar]' (for 'pressure_2_pa') is missing" in report
    assert '<div class="plot"' not in page
    assert "is missing" in page


def test_logs_at_another_rate_are_smoothed_as_long_without_a_note(tmp_path: Path, log: pd.DataFrame) -> None:
    report, refused, _ = inspected(tmp_path, log.iloc[::2])
    assert not refused
    assert "filter_windows" not in report


def test_every_piece_of_a_file_is_shown(tmp_path: Path, log: pd.DataFrame) -> None:
    report, refused, page = inspected(tmp_path, pd.concat([log.iloc[:1300], log.iloc[1400:2600], log.iloc[2700:]]))
    assert not refused
    for part in (1, 2, 3):
        assert f"(part {part}): usable with these repairs; friction " in report
        assert f'<section id="recording-{part}"' in page
    assert page.count('<div class="plot"') >= 3
    assert report.count("  repaired  repair  time: split at 2 gaps") == 3
    assert report.endswith("1 file: 1 repaired")


CYLINDER = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6.0"


def test_without_a_project_logs_are_inspected_as_estimate_reads_them(
    tmp_path: Path, log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    log.to_csv("press.csv", index=False)
    assert main(["inspect", "press.csv", "--cylinder", CYLINDER, "--output", "guessed.html"]) == 0
    words = capsys.readouterr().out
    assert words.startswith("note     no mapping was given; guessed from press.csv")
    assert "press.csv: usable" in words
    assert '<div class="plot"' in unpacked(Path("guessed.html").read_text(encoding="utf-8"))
    assert main(["ingest", "init", "press.csv", "--output", "press.yaml"]) == 0
    swapped(log).to_csv("swapped.csv", index=False)
    assert main(["inspect", "swapped.csv", "--cylinder", CYLINDER, "--channels", "press.yaml"]) == 1
    assert "the pressures are swapped" in capsys.readouterr().out
    log.to_csv("again.csv", index=False)
    assert main(["inspect", "press.csv", "again.csv", "--cylinder", CYLINDER]) == 1
    words = capsys.readouterr().out
    assert "again.csv: usable" in words
    assert "press.csv: not usable" in words  # as it holds the same
    assert main(["inspect", "press.csv", "ingest=own", "--cylinder", CYLINDER]) == 1
    assert "overrides such as 'ingest=own' are for a project" in capsys.readouterr().err


UNITS = {"time": "s", "P1": "bar", "P2": "bar", "pos": "mm"}
ENDINGS = {"matlab5": "mat", "matlab73": "mat", "mdf4": "mf4", "decimal_comma": "csv", "csv_gz": "csv.gz", "hdf5": "h5"}


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the shipped configuration, in which the commands run."""
    shutil.copytree(CONF, tmp_path / "conf")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def ingest_as(name: str) -> list[Recording]:
    ingest.run(check_params(compose_params(Path("conf"), [f"ingest={name}"]), name))
    return read_stored(RECORDINGS_FOLDER)


@pytest.mark.parametrize("name", SAMPLES)
def test_a_first_mapping_ingests_every_format(workplace: Path, labelled_recordings: list[Recording], name: str) -> None:
    log = workplace / f"logs/noload_day1.{ENDINGS.get(name, name)}"
    log.parent.mkdir()
    SAMPLES[name].write(log, sampled(labelled_recordings[0], UNITS), UNITS)
    assert main(["ingest", "init", str(log), "--output", "conf/ingest/press.yaml"]) == 0
    (recording,) = ingest_as("press")
    assert (recording.metadata.condition, recording.metadata.session) == ("noload", "noload_day1")
    np.testing.assert_allclose(recording.samples(), labelled_recordings[0].samples(), rtol=1e-9)


def test_a_first_mapping_is_printed_and_never_takes_the_place_of_another(
    workplace: Path, log: pd.DataFrame, capsys: pytest.CaptureFixture[str]
) -> None:
    log.to_csv("a_b.csv", index=False)
    assert main(["ingest", "init", "a_b.csv"]) == 0
    position = yaml.safe_load(capsys.readouterr().out)["channels"]["position_m"]
    assert position == {"channel": "Position [mm]", "unit": "mm"}
    before = (workplace / "conf/ingest/rig.yaml").read_bytes()
    assert main(["ingest", "init", "a_b.csv", "--output", "conf/ingest/rig.yaml"]) == 1
    assert "conf/ingest/rig.yaml: is there already; name another file, or remove it first" in capsys.readouterr().err
    assert (workplace / "conf/ingest/rig.yaml").read_bytes() == before


def test_a_file_that_is_no_log_is_an_error_with_a_message(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (workplace / "empty.csv").write_bytes(b"")
    assert main(["ingest", "init", "empty.csv"]) == 1
    assert main(["ingest", "init", "nowhere.csv"]) == 1
    errors = capsys.readouterr().err
    assert errors.count("cylinder-friction ingest init: ") == 2
    assert "nowhere.csv: no such file; name a logger's file" in errors


def test_inspect_prints_the_checks_and_writes_the_page(
    workplace: Path, log: pd.DataFrame, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", str(write(workplace / "logs", log)), "ingest=rig", "--output", "page.html"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("condition1_session01_recording01.csv: usable for labelling; friction 334 N (half of")
    assert "  ok  " not in told, "what is in order is on the page"
    assert told.endswith("\n\n1 file: 1 ok\n\npage     page.html\n")
    assert "condition1_session01" in (workplace / "page.html").read_text(encoding="utf-8")


def test_a_refused_file_in_a_folder_is_told_by_the_exit_status(
    workplace: Path, log: pd.DataFrame, labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    for session, recording in enumerate(labelled_recordings[:2], start=1):
        write(workplace / "logs", sampled(recording, COLUMNS), session)
    write(workplace / "logs", log.assign(**{POSITION: 120.0}), 3)
    assert main(["inspect", "logs", "ingest=rig"]) == 1
    told = capsys.readouterr().out
    assert "3 files: 2 ok, 1 refused" in told
    assert "condition1_session03_recording01.csv: not usable\n  refused   motion " in told
    assert 'id="recording-3"' in (workplace / "reports/inspection.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere", "ingest=rig"], "nowhere: neither a file nor a folder"),
        (["conf", "ingest=rig"], "conf: no file matches '*.csv'; name another folder or ingest.pattern"),
        (["conf", "ingest=none_such"], "none_such"),
        (["a.csv", "--output", "page.txt"], "--output: expected a file whose name ends in .html, but got 'page.txt'"),
        (["a.csv", "b.csv", "ingest=rig"], "got 'b.csv' after 'a.csv'; to inspect several files, name the folder"),
    ],
)
def test_what_cannot_be_inspected_is_told(
    workplace: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", *arguments]) == 1
    assert message in capsys.readouterr().err
