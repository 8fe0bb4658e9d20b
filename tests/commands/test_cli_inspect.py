"""The two commands that look at a logger's file: a first mapping of it, and what the checks and the page say."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from cylinder_friction.commands.cli import main
from cylinder_friction.commands.params import compose_params
from cylinder_friction.params.checking import check_params
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.stages import ingest
from cylinder_friction.stages._stage import RECORDINGS_FOLDER
from format_writers import SAMPLES

CONF = Path(__file__).parents[2] / "conf"
UNITS = {"time": "s", "P1": "bar", "P2": "bar", "pos": "mm"}
ENDINGS = {"matlab5": "mat", "matlab73": "mat", "mdf4": "mf4", "decimal_comma": "csv", "csv_gz": "csv.gz", "hdf5": "h5"}


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the shipped configuration, in which the commands run."""
    shutil.copytree(CONF, tmp_path / "conf")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def logged(recording: Recording) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "time": recording.column("time_s"),
            "P1": recording.column("pressure_1_pa") / 1e5,
            "P2": recording.column("pressure_2_pa") / 1e5,
            "pos": recording.column("position_m") * 1e3,
        }
    )


def write_rig_log(path: Path, log: pd.DataFrame) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    named = log.set_axis(["Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]"], axis=1)
    named.assign(**{"Oil temperature [degC]": 37.0}).to_csv(path, index=False)


def ingest_as(name: str) -> list[Recording]:
    ingest.run(check_params(compose_params(Path("conf"), [f"ingest={name}"]), name))
    return read_stored(RECORDINGS_FOLDER)


@pytest.mark.parametrize("name", SAMPLES)
def test_the_first_mapping_of_every_format_ingests_it(
    workplace: Path, labelled_recordings: list[Recording], name: str
) -> None:
    log = workplace / f"logs/noload_day1.{ENDINGS.get(name, name)}"
    log.parent.mkdir()
    SAMPLES[name].write(log, logged(labelled_recordings[0]), UNITS)
    assert main(["ingest", "init", str(log), "--output", "conf/ingest/press.yaml"]) == 0
    (recording,) = ingest_as("press")
    assert (recording.metadata.condition, recording.metadata.session) == ("noload", "noload_day1")
    np.testing.assert_allclose(recording.samples(), labelled_recordings[0].samples(), rtol=1e-9)


def test_without_an_output_the_mapping_is_printed(
    workplace: Path, labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    write_rig_log(workplace / "a_b.csv", logged(labelled_recordings[0]))
    assert main(["ingest", "init", "a_b.csv"]) == 0
    assert yaml.safe_load(capsys.readouterr().out)["channels"]["position_m"] == {
        "channel": "Position [mm]",
        "unit": "mm",
    }


def test_a_mapping_that_is_there_is_not_overwritten(
    workplace: Path, labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    write_rig_log(workplace / "a_b.csv", logged(labelled_recordings[0]))
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
    workplace: Path, labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    log = workplace / "data/raw/rig/condition1_session01_recording01.csv"
    write_rig_log(log, logged(labelled_recordings[0]))
    assert main(["inspect", str(log), "ingest=rig", "--output", "page.html"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("condition1_session01_recording01.csv: usable for labelling\n  ok        friction  ")
    assert told.endswith("\n\n1 file: 1 ok\n\npage     page.html\n")
    assert "condition1_session01" in (workplace / "page.html").read_text(encoding="utf-8")


def test_a_refused_file_in_a_folder_is_told_by_the_exit_status(
    workplace: Path, labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    for number, recording in enumerate(labelled_recordings[:2], start=1):
        write_rig_log(workplace / f"logs/condition1_session0{number}_recording01.csv", logged(recording))
    bad = logged(labelled_recordings[2]).assign(pos=120.0)
    write_rig_log(workplace / "logs/condition1_session03_recording01.csv", bad)
    assert main(["inspect", "logs", "ingest=rig"]) == 1
    told = capsys.readouterr().out
    assert "3 files: 2 ok, 1 refused" in told
    assert "condition1_session03_recording01.csv: not usable: position_m moves by 0 m only" in told
    assert 'id="recording-3"' in (workplace / "reports/inspection.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere", "ingest=rig"], "nowhere: neither a file nor a folder"),
        (["conf", "ingest=rig"], "conf: no file matches '*.csv'; name another folder or ingest.pattern"),
        (["conf", "ingest=none_such"], "none_such"),
        (["conf"], "params.yaml"),
        (
            ["a.csv", "b.csv", "ingest=rig"],
            "expected one path and then overrides such as ingest=own, but got 'b.csv' after 'a.csv'; to inspect "
            "several files, name the folder that holds them",
        ),
    ],
)
def test_what_cannot_be_inspected_is_told(
    workplace: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", *arguments]) == 1
    assert message in capsys.readouterr().err
