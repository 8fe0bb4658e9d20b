"""The command ``estimate``: what it prints, its exit status, and how a cylinder is stated."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.commands.log_options import cylinder_of
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.params.file import ParamsError
from cylinder_friction.recordings.recording import Recording
from friction_samples import PLAIN_LUGRE
from logger_files import CHANNELS, write_lugre_log

GEOMETRY = "bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0"


@pytest.fixture
def log(tmp_path: Path, labelled_recordings: list[Recording]) -> Path:
    recording = labelled_recordings[0]
    table = recording.table[["time_s", "pressure_1_pa", "pressure_2_pa", "position_m"]]
    table.columns = ["Time [s]", "P1 [Pa]", "P2 [Pa]", "Position [m]"]
    table.to_csv(tmp_path / "stroke.csv", index=False)
    return tmp_path / "stroke.csv"


def test_one_line_per_new_file_and_the_page(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["estimate", str(log), "--cylinder", GEOMETRY]
    assert main([*given, "--output", f"{tmp_path}/out"]) == 0
    printed = capsys.readouterr().out
    assert "guessed from stroke.csv" in printed
    assert "stroke: friction " in printed
    assert f"page     {tmp_path}/out/friction.html" in printed
    assert main([*given, "--into", f"{tmp_path}/out"]) == 0
    printed = capsys.readouterr().out
    assert "1 result of earlier runs kept\n" in printed
    assert "stroke: friction" not in printed
    table = pd.read_csv(log)
    table.drop(index=range(len(table) - 700, len(table) - 600)).to_csv(log, index=False)
    assert main([*given, "--output", f"{tmp_path}/gap"]) == 1
    assert "\nstroke.csv (piece 2 of 2): refused: lasts 3 s" in capsys.readouterr().out


def test_json_is_all_that_is_printed(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.csv").write_text("Time [s],P1 [Pa]\n0,1\n", encoding="utf-8")
    arguments = [str(log), str(tmp_path / "bad.csv"), "--cylinder", GEOMETRY, "--output", str(tmp_path / "out")]
    assert main(["ingest", "init", str(log), "--output", str(tmp_path / "mapping.yaml")]) == 0
    capsys.readouterr()
    assert main(["estimate", *arguments, "--channels", str(tmp_path / "mapping.yaml"), "--json"]) == 1
    content = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in content["recordings"]] == ["stroke"]
    assert content["refused"][0]["file"] == "bad.csv"


def test_an_unknown_friction_has_its_reason_in_estimate_and_inspect(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A position in cm that is read as mm is too slow; a first mapping does not choose one of the two."""
    table = pd.read_csv(log)
    table["Position [m]"] *= 100.0
    table.rename(columns={"Position [m]": "Position"}).to_csv(log, index=False)
    assert main(["ingest", "init", str(log), "--output", str(tmp_path / "mapping.yaml")]) == 0
    assert 'unit: "mm or in or cm"' in (tmp_path / "mapping.yaml").read_text(encoding="utf-8")
    for command, output in (("estimate", "out"), ("inspect", "page.html")):
        given = [command, str(log), "--cylinder", GEOMETRY, "--output", str(tmp_path / output)]
        assert main([*given, "--channels", str(tmp_path / "mapping.yaml")]) == 1
        assert "unit 'mm or in or cm' is not known" in capsys.readouterr().err
        assert main([*given, "--unit", "length=mm"]) == (command == "estimate")
        said = capsys.readouterr().out
        assert "friction unknown" in said
        assert "no position is passed both ways faster than 6 mm/s (away from the end stops, at most " in said


def test_another_log_than_the_guess_is_of_is_told_how_a_mapping_is_given(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pd.read_csv(log).rename(columns={"P1 [Pa]": "pA [Pa]"}).to_csv(tmp_path / "z.csv", index=False)
    logs = [str(log), str(tmp_path / "z.csv"), "--cylinder", GEOMETRY]
    for command, output in (("estimate", "out"), ("inspect", "page.html")):
        assert main([command, *logs, "--output", str(tmp_path / output)]) == 1
        said = capsys.readouterr().out
        assert "channels.pressure_1_pa.channel in the mapping" in said
        assert (
            "mapping named above was guessed from stroke.csv, as no mapping was given: `cylinder-friction ing" in said
        )


def test_nothing_is_said_about_bounds_of_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, rows = tmp_path / "short.csv", "".join(f"{each / 10},1,{each},3\n" for each in range(9))
    log.write_text(f"Time [s],P1 [bar],P2 [bar],Position [mm]\n{rows}", encoding="utf-8")
    assert main(["estimate", str(log), "--cylinder", GEOMETRY, "--output", str(tmp_path / "out")]) == 1
    assert "bounds   none: no log was usable\n" in capsys.readouterr().out


def test_results_are_the_same_whoever_works(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cylinder_friction.commands.estimate.FEW_FILES", 1)
    written = []
    for count in ("1", "2"):
        arguments = ["estimate", str(log), "--cylinder", GEOMETRY, "--output", str(tmp_path / count)]
        assert main([*arguments, "--workers", count]) == 0
        written.append((tmp_path / count / "stroke.parquet").read_bytes())
    assert written[0] == written[1]
    assert main([*arguments, "--workers", "0"]) == 1
    assert "--workers: got 0, expected at least 1" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "status", "without"),
    [
        (["--help"], 0, ("numpy",)),
        (["--mistyped"], 2, ("numpy",)),
        (["LOG"], 0, ("scipy.signal", "matplotlib", "plotly", "onnx", "pydantic", "torch")),
    ],
    ids=["help", "a mistyped option", "a label"],
)
def test_imports_stay_few(
    log: Path, tmp_path: Path, arguments: list[str], status: int, without: tuple[str, ...]
) -> None:
    given = ["estimate", *arguments, *(["--cylinder", GEOMETRY, "--output", str(tmp_path / "out")] * (status == 0))]
    given = [str(log) if each == "LOG" else each for each in given]
    code = (
        "import sys\nfrom cylinder_friction.commands.cli import main\n"
        f"try:\n    status = main({given!r})\nexcept SystemExit as ended:\n    status = ended.code\n"
        f"print(*sorted({set(without)!r} & set(sys.modules)), file=sys.stderr)\nsys.exit(status)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.splitlines()[-1:]) == (status, [""])


def test_a_cylinder_is_stated_as_pairs_or_as_a_file(tmp_path: Path) -> None:
    expected = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
    assert cylinder_of(GEOMETRY) == expected
    assert repr(cylinder_of(GEOMETRY.replace("6.0", "6"))) == repr(expected), "whole numbers"
    (tmp_path / "press.yaml").write_text(GEOMETRY.replace("=", ": ").replace(", ", "\n"), encoding="utf-8")
    assert cylinder_of(str(tmp_path / "press.yaml")) == expected
    assert cylinder_of(f"{GEOMETRY}, rod_diameter_1_m=0.028") == replace(expected, rod_diameter_1_m=0.028)


@pytest.mark.parametrize(("load", "status"), [((), 1), (("--load", "-900"), 0), (("--load", "-900+-40"), 0)])
def test_friction_with_a_load_in_it_is_not_known(
    load: tuple[str, ...], status: int, cylinder: Cylinder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_lugre_log(tmp_path / "r.csv", PLAIN_LUGRE, cylinder, [0.02, 0.05] * 4, load_n=-900.0)
    (tmp_path / "mapping.yaml").write_text(json.dumps({"channels": CHANNELS}), encoding="utf-8")
    given = ["estimate", str(log), "--cylinder", GEOMETRY, "--channels", str(tmp_path / "mapping.yaml")]
    assert main([*given, *load, "--output", str(tmp_path / "out")]) == status
    assert ("friction_n holds a load" in capsys.readouterr().out) == (status == 1)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("bore_m=0.063", "unknown bore_m; expected .*, moving_mass_kg, and if you like name, rod_diameter_1_m"),
        ("bore_diameter_m=0.063", "missing moving_mass_kg, rod_diameter_m, stroke_m"),
    ],
)
def test_a_wrong_cylinder_is_refused(given: str, said: str) -> None:
    with pytest.raises(ParamsError, match=said):
        cylinder_of(given)


@pytest.mark.parametrize(("command", "summary"), [("estimate", "summary.json"), ("identify", "friction_models.json")])
def test_what_was_guessed_stands_in_the_summary_and_on_the_page(
    command: str, summary: str, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    log.write_text("".join(["t,p1,p2<script>alert(1)</script>,x\n", *lines[1:]]), encoding="utf-8")
    out = tmp_path / "out"
    generations = ["--generations", "1"] if command == "identify" else []
    given = [command, str(log), "--cylinder", GEOMETRY, "--output", str(out), "--unit", "pressure=Pa", *generations]
    assert main(given) == (1 if command == "identify" else 0), "one speed determines no model"
    guessed = json.loads((out / summary).read_text(encoding="utf-8"))["guessed"]
    assert guessed["from"] == "stroke.csv"
    assert set(guessed["columns"]) == {"time_s", "pressure_1_pa", "pressure_2_pa", "position_m"}
    assert "unit Pa as given" in guessed["columns"]["pressure_1_pa"]["reasons"]
    assert guessed["columns"]["position_m"]["check"] == ["the unit is stated nowhere"]
    (page,) = out.glob("*.html")
    text = page.read_text(encoding="utf-8")
    assert "Guessed channels and units" in text
    assert "unit Pa as given" in text
    assert "alert(1)</script>" not in text


@pytest.mark.parametrize("given", [["pressure"], ["=bar"], ["pressure="], ["pressure=bar", "pressure=psi"]])
def test_a_unit_of_another_form_is_refused(given: list[str], log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = [word for each in given for word in ("--unit", each)]
    assert main(["estimate", str(log), "--cylinder", GEOMETRY, *options]) == 1
    assert f"--unit {given[-1]}: expected QUANTITY=UNIT such as pressure=bar" in capsys.readouterr().err


def test_a_cylinder_that_nobody_stated_here_is_named(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "params.yaml").write_text(f"cylinder: {{name: press, {GEOMETRY.replace('=', ': ')}}}\n")
    assert main(["estimate", str(log)]) == 0
    named = "the cylinder is that of params.yaml, press (63 mm bore, 28 mm rod); state yours by --cylinder"
    assert named in capsys.readouterr().out
