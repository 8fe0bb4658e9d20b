"""Inspecting files: whatever is wrong with them, the checks say it and the page shows it where it can be read."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.commands.inspect import inspect_path
from cylinder_friction.commands.params import compose_params
from cylinder_friction.params.checking import Params, check_params
from cylinder_friction.recordings.recording import Recording
from packed_pages import unpacked

Damage = Callable[[pd.DataFrame], pd.DataFrame]

CONF = Path(__file__).parents[2] / "conf"
TIME, P1, P2, POSITION = "Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]"


@cache
def params_for(*overrides: str) -> Params:
    return check_params(compose_params(CONF, ["ingest=rig", *overrides]), "conf")


@pytest.fixture
def log(labelled_recordings: list[Recording]) -> pd.DataFrame:
    recording = labelled_recordings[0]
    return pd.DataFrame(
        {
            TIME: recording.column("time_s"),
            P1: recording.column("pressure_1_pa") / 1e5,
            P2: recording.column("pressure_2_pa") / 1e5,
            POSITION: recording.column("position_m") * 1e3,
            "Oil temperature [degC]": np.full(len(recording), 37.0),
        }
    )


def write(folder: Path, log: pd.DataFrame, session: int = 1) -> Path:
    path = folder / f"condition1_session{session:02d}_recording01.csv"
    folder.mkdir(exist_ok=True)
    log.to_csv(path, index=False)
    return path


def stuck(log: pd.DataFrame, column: str, first: int, last: int) -> pd.DataFrame:
    return held_at(log, column, first, last, float(log[column].to_numpy()[first]))


def held_at(log: pd.DataFrame, column: str, first: int, last: int, value: float) -> pd.DataFrame:
    values = log[column].to_numpy(copy=True)
    values[first:last] = value
    return log.assign(**{column: values})


def swapped(log: pd.DataFrame) -> pd.DataFrame:
    return log.assign(**{P1: log[P2], P2: log[P1]})


REFUSED: dict[str, tuple[Damage, str]] = {
    "position constant": (lambda log: log.assign(**{POSITION: 120.0}), "motion"),
    "position inverted": (lambda log: log.assign(**{POSITION: 250.0 - log[POSITION]}), "direction"),
    "pressures the same": (lambda log: log.assign(**{P2: log[P1]}), "pressures_differ"),
    "pressure beyond the sensor": (lambda log: held_at(log, P1, 1000, 1200, 400.0), "file"),
    "position stuck early on": (lambda log: stuck(log, POSITION, 500, 1100), "length"),  # of what lies before
    "too short for the filters": (lambda log: log.iloc[:20], "length"),
    "a few rows": (lambda log: log.iloc[:4], "length"),
    "rate too low": (lambda log: log.iloc[::20], "rate"),
}


@pytest.mark.parametrize("name", list(REFUSED))
def test_what_is_refused_is_told_and_shown_all_the_same(tmp_path: Path, log: pd.DataFrame, name: str) -> None:
    damage, check = REFUSED[name]
    path = write(tmp_path / "logs", damage(log))
    report, refused = inspect_path(path, params_for(), tmp_path / "page.html")
    assert refused
    assert any(line.split()[:2] == ["refused", check] for line in report.splitlines()), report
    page = unpacked((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert '<div class="plot"' in page
    assert "What follows is drawn to show what is wrong, and is no result." in page


@pytest.mark.parametrize("load", ["none", "position"])
@pytest.mark.parametrize("name", ["swapped pressures", "one direction", "spikes", "noise alone"])
def test_odd_recordings_make_a_page_too(tmp_path: Path, log: pd.DataFrame, name: str, load: str) -> None:
    random = np.random.default_rng(4)
    damages: dict[str, Damage] = {
        "swapped pressures": swapped,
        "one direction": lambda log: log.assign(**{POSITION: np.linspace(20.0, 230.0, len(log))}),
        "spikes": lambda log: log.assign(**{P1: log[P1] + 100.0 * (np.arange(len(log)) == 77)}),
        "noise alone": lambda log: log.assign(**{POSITION: 120.0 + random.normal(0.0, 2.0, len(log))}),
    }
    path = write(tmp_path / "logs", damages[name](log))
    report, _ = inspect_path(path, params_for(f"ingest.load={load}"), tmp_path / "page.html")
    assert report.startswith(path.name)
    assert '<div class="plot"' in unpacked((tmp_path / "page.html").read_text(encoding="utf-8"))


def test_what_is_no_recording_at_all_has_its_reason_in_the_table(tmp_path: Path, log: pd.DataFrame) -> None:
    path = write(tmp_path / "logs", log.drop(columns=[P2]))
    report, refused = inspect_path(path, params_for(), tmp_path / "page.html")
    assert refused
    assert "'P2 [bar]' (for 'pressure_2_pa') is missing" in report
    page = unpacked((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert '<div class="plot"' not in page
    assert "is missing" in page


def test_windows_that_last_another_time_at_the_logs_rate_are_noted(tmp_path: Path, log: pd.DataFrame) -> None:
    report, refused = inspect_path(write(tmp_path, log.iloc[::2]), params_for(), tmp_path / "page.html")
    assert not refused
    assert "filter windows are in samples and were chosen for 200 Hz, but recordings come at 100 Hz" in report


def test_every_piece_of_a_file_is_shown(tmp_path: Path, log: pd.DataFrame) -> None:
    path = write(tmp_path / "logs", pd.concat([log.iloc[:1300], log.iloc[1400:2600], log.iloc[2700:]]))
    report, refused = inspect_path(path, params_for(), tmp_path / "page.html")
    assert not refused
    page = unpacked((tmp_path / "page.html").read_text(encoding="utf-8"))
    for part in (1, 2, 3):
        assert f"(part {part}): usable with these repairs: time: split at 2 gaps" in report
        assert f'<section id="recording-{part}"' in page
    assert page.count('<div class="plot"') >= 3
    assert report.endswith("1 file: 1 repaired")


CYLINDER = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6.0"


def test_without_a_project_logs_are_inspected_as_estimate_reads_them(
    tmp_path: Path, log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    log.to_csv("press.csv", index=False)
    assert main(["inspect", "press.csv"]) == 1
    assert "Give its dimensions, for example --cylinder bore_diameter_m=" in capsys.readouterr().err
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
