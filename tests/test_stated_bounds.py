"""What bounds hold is stated in one sentence wherever they are printed, drawn, served or exported."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.brought_code import model_metadata
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.deployment.fmu.variables import fmu_variables
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.model_card import model_card
from logger_files import write_log

UNITS = ["--unit", "pressure=bar", "--unit", "length=mm"]
CYLINDER = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6.0"


@pytest.fixture(scope="module", params=["friction", "label"])
def stated(request: pytest.FixtureRequest, small_hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory):
    """An estimator whose bounds hold friction, or the label, the folder that it is saved in, and their sentence."""
    holds: Literal["friction", "label"] = request.param
    folder = tmp_path_factory.mktemp(holds) / "model"
    small_hybrid.save(folder)
    estimator = HybridEstimator.load(folder)
    assert estimator.bounds is not None
    estimator.bounds = replace(estimator.bounds, holds=holds)
    estimator.save(folder)
    words = estimator.bounds.in_words()
    assert words.startswith("they hold friction" if holds == "friction" else "they hold the label")
    assert ("nothing was stated" in words) == (holds == "label")
    assert "over sessions like those of the calibration" in words, "of which there may be one"
    return estimator, folder, words


def test_exported_code_and_its_descriptions(stated, tmp_path: Path, cylinder: Cylinder) -> None:
    estimator, folder, words = stated
    export_c(estimator, tmp_path / "c", "friction")
    assert words in " ".join((tmp_path / "c/friction.h").read_text().split())
    assert sum(words in each.description for each in fmu_variables(estimator.step_model())) == 2, "at either bound"
    assert model_metadata(estimator.step_model())["bounds"] == words, "of the served model"
    numbers = {"1": {"label_percent": 2.0}}
    assert words in model_card("hybrid", cylinder, read_json(folder / "estimator.json"), {}, {}, numbers, [])


def test_estimate_with_a_model(
    stated, tmp_path: Path, labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    _, folder, words = stated
    log, output = write_log(tmp_path / "log.csv", labelled_recordings[0]), tmp_path / "out"
    main(["estimate", str(log), "--cylinder", CYLINDER, *UNITS, "--model", str(folder), "--output", str(output)])
    assert f"bounds   {words}" in capsys.readouterr().out
    assert json.loads((output / "summary.json").read_text())["bounds"] == words


def test_estimate_without_a_model(
    tmp_path: Path, labelled_recordings: list[Recording], capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.csv"
    write_log(log, labelled_recordings[0])
    command = ["estimate", str(log), "--cylinder", CYLINDER, *UNITS, "--output", str(tmp_path / "out")]
    main([*command, "--sensor-class", "0.5"])
    assert (
        "friction half of extending less retracting at equal position\n"
        "bounds   they hold friction in about 95 % of the rows (k = 2) if sensors, load and cylinder are as stated; "
        "docs/trust.md lists each assumption and what happens if it is wrong; assumed, not stated: "
        "pressure_1_pa ± 0.5 % of 250 bar, pressure_2_pa ± 0.5 % of 250 bar\n"
    ) in capsys.readouterr().out
    one = labelled_recordings[0]
    write_log(log, one.with_columns(pressure_1_pa=one.column("pressure_1_pa") + 0.45e5))
    main([*command, "--sensor-class", "0.05"])
    first = capsys.readouterr().out
    main([*command, "--sensor-class", "0.05"])
    again = capsys.readouterr().out
    assert "1 result of earlier runs kept" in again
    assert re.findall("^bounds.*", again, re.MULTILINE) == re.findall("^bounds.*", first, re.MULTILINE)
    assert re.search(
        r"if it is wrong; but in 1 session \(first log\): [\d.]+ N does not turn with the direction, while the stated "
        r"zeros and an asymmetry of friction explain [\d.]+ N; a load acts,",
        first,
    )
    assert main([*command, "--sensor-class", "0"]) == 1
    assert "sensor class: got 0, expected a number above 0" in capsys.readouterr().err
