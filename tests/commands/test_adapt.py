"""The command ``adapt``: a model that the other commands take for the new cylinder alone, and named refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

import cylinder_friction as cf
from cylinder_friction.commands.cli import main
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.c_export.compiled import CompiledEstimator, CompiledStream
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators import hybrid
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.realtime.stream import CompiledRun
from cylinder_friction.recordings.recording import Recording
from inspected_recordings import made_strokes
from logger_files import CHANNELS, STATED, write_log

PRESS = "bore_diameter_m=0.08, rod_diameter_m=0.045, stroke_m=0.25, moving_mass_kg=6.0"
OFFSETS_N = (25.0, -5.0, -20.0, 10.0, -10.0, 15.0, -15.0, 5.0, -12.0, 12.0, 2.0, -7.0)
OLD = "bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0"


@pytest.fixture
def given(
    tmp_path: Path, small_hybrid: HybridEstimator, labelled_recordings: list[Recording], monkeypatch: pytest.MonkeyPatch
) -> list[str]:
    """Return the command line; the logs are of the old cylinder, which a larger one would read as more friction."""
    monkeypatch.setattr(hybrid, "ADAPTATION_PLAN", TrainingPlan(1, None, 200, 20, 4))
    small_hybrid.save(tmp_path / "source")
    for number, recording in enumerate(labelled_recordings[:2]):
        write_log(tmp_path / f"logs/{number}.csv", recording)
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump({"channels": CHANNELS}), encoding="utf-8")
    options = {"--cylinder": PRESS, "--channels": tmp_path / "mapping.yaml", "--output": tmp_path / "adapted"}
    words = (str(word) for pair in options.items() for word in pair)
    return ["adapt", str(tmp_path / "source"), str(tmp_path / "logs"), *words]


def test_the_model_is_taken_for_the_new_cylinder_and_refused_for_the_old_one(
    given: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(given) == 0
    printed = capsys.readouterr().out
    assert "for      a cylinder of 80 mm bore and 45 mm rod, with friction of " in printed
    assert "its bounds rest on 2 sessions, each estimated by a model that was not trained on it" in printed
    assert "gain     error " in printed
    assert f"model    {tmp_path}/adapted" in printed
    assert "offset   of the sensors' zeros: not identified: recording '0': the uncertainty of the zero of " in printed
    model = load_estimator(tmp_path / "adapted")
    assert np.isfinite(model.step_model().bounds.upper_n).all()
    estimate = ["estimate", given[2], "--channels", given[6], "--model", str(tmp_path / "adapted")]
    assert main([*estimate, "--cylinder", PRESS, "--output", str(tmp_path / "friction")]) in (0, 1)
    assert (tmp_path / "friction/0.parquet").is_file()
    capsys.readouterr()
    assert main([*estimate, "--cylinder", OLD, "--output", str(tmp_path / "refused")]) == 1
    assert "was trained for a cylinder of 80 mm bore and 45 mm rod" in capsys.readouterr().err
    assert not (tmp_path / "refused").exists()
    assert main([*given, "--json"]) == 0  # into the folder of the earlier run
    content = json.loads(capsys.readouterr().out)
    assert content["recordings"] == ["0", "1"]
    assert content["source"] == str(tmp_path / "source")


def test_what_it_exports_takes_the_readings_of_the_sensors(
    given: list[str],
    tmp_path: Path,
    cylinder: Cylinder,
    labelled_recordings: list[Recording],
    capsys: pytest.CaptureFixture[str],
) -> None:
    line = {"line_loss": {"bar": 0.5, "speed_m_s": 0.1}}
    signed = {"position_m": {"sign": -1, "offset": 250.0}, "pressure_1_pa": {"offset": 1.3, "sensor": line}}
    mapping = {name: own | signed.get(name, {}) for name, own in CHANNELS.items()}
    for number, recording in enumerate(labelled_recordings[:2]):
        moved = recording.with_columns(position_m=0.25 - recording.column("position_m"))
        write_log(tmp_path / f"logs/{number}.csv", moved, zero_bar=1.3)
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump({"channels": mapping}), encoding="utf-8")
    assert main(given) == 0
    lost = "loss of its line (0.5 bar at 0.1 m/s ± 75 %)"
    applied = f"pressure_1_pa = reading - 1.3 bar - {lost}, position_m = -(reading - 0.25 m)"
    assert f"the step makes {applied}" in capsys.readouterr().out
    model = load_estimator(tmp_path / "adapted")
    (recording,) = cf.read_recordings(tmp_path / "logs/1.csv", tmp_path / "mapping.yaml", cylinder)
    np.testing.assert_allclose(recording.samples(), labelled_recordings[1].samples(), rtol=1e-9, atol=1e-3)
    log = pd.read_csv(tmp_path / "logs/1.csv")
    readings = log[["p1", "p2", "x"]].to_numpy() * [1e5, 1e5, 1e-3]
    exported = export_c(model, tmp_path / "c")
    assert applied in exported.header.read_text(encoding="utf-8")
    newtons, flags = CompiledStream(CompiledEstimator(exported)).run(readings)
    step = CompiledRun(model.step_model().for_recordings())
    expected, expected_flags = step.run(recording.samples())
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=1e-3)
    np.testing.assert_array_equal(flags, expected_flags)
    np.testing.assert_allclose(model.estimate(recording), expected[:, 0], rtol=0.0, atol=1e-9)


@pytest.mark.extended
def test_offsets_that_strokes_show_are_taken_off_and_learned(
    given: list[str], tmp_path: Path, cylinder: Cylinder, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, offset_n in enumerate(OFFSETS_N):
        write_log(tmp_path / f"offsets/{number:02d}.csv", made_strokes(cylinder, 100.0 + offset_n, seconds=30.0))
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump({"channels": STATED}), encoding="utf-8")
    given[2], given[given.index(PRESS)] = str(tmp_path / "offsets"), OLD
    assert main([*given, "--load", "100+-1"]) == 0
    printed = capsys.readouterr().out
    assert (
        "offset   of the sensors' zeros: identified from strokes in 12 of 12 sessions and subtracted from " in printed
    )
    assert "; the model learns that of a new session while it runs\n" in printed
    assert "; an error of the load (100 ± 1 N, as stated) comes on top\n" in printed
    model = load_estimator(tmp_path / "adapted")
    assert model.offset is not None
    assert model.position_load is not None
    assert model.position_load.in_words().startswith("a load of 100 N between 0 and 0.25 m, known to 0.577 N")
    assert main([*given, "--load", "position"]) == 0
    words = "not identified: a load identified from position has absorbed the sensors' offset; the model learns none\n"
    assert f"offset   of the sensors' zeros: {words}" in capsys.readouterr().out


def test_what_cannot_be_adapted_is_named_and_leaves_nothing(
    given: list[str],
    tmp_path: Path,
    cylinder: Cylinder,
    labelled_recordings: list[Recording],
    capsys: pytest.CaptureFixture[str],
) -> None:
    RidgeEstimator().fit(labelled_recordings[:1]).save(tmp_path / "ridge")
    assert main([given[0], str(tmp_path / "ridge"), *given[2:]]) == 1
    assert capsys.readouterr().err == (
        f"cylinder-friction adapt: {tmp_path}/ridge: is of the kind 'ridge', expected a hybrid; no other can be "
        "adapted\n"
    )
    assert main([*given[:-1], str(tmp_path / "source")]) == 1
    assert "is, or holds, the input" in capsys.readouterr().err
    write_log(tmp_path / "short/0.csv", labelled_recordings[0].rows(slice(0, 1200)))
    assert main([*given[:2], str(tmp_path / "short"), *given[3:]]) == 1
    assert "record more strokes in both directions" in capsys.readouterr().err
    assert not (tmp_path / "adapted").exists()
