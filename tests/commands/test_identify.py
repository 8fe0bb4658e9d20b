"""The command ``identify``: what it prints, and its exit status."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from cylinder_friction.commands.cli import main
from cylinder_friction.cylinder import Cylinder
from friction_samples import PLAIN_LUGRE
from logger_files import CHANNELS, write_lugre_log

GEOMETRY = "bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0"


def arguments(tmp_path: Path, cylinder: Cylinder, speeds_m_s: list[float]) -> list[str]:
    log = write_lugre_log(tmp_path / "r.csv", PLAIN_LUGRE, cylinder, speeds_m_s, pressure_2_pa=(6e6, 2e5))
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump({"channels": CHANNELS}), encoding="utf-8")
    options = {"--cylinder": GEOMETRY, "--channels": tmp_path / "mapping.yaml", "--output": tmp_path / "out"}
    return ["identify", str(log), *(str(word) for pair in options.items() for word in pair)]


def test_parameters_are_printed(tmp_path: Path, cylinder: Cylinder, capsys: pytest.CaptureFixture[str]) -> None:
    given = arguments(tmp_path, cylinder, [*np.geomspace(8e-3, 0.06, 9)] * 2)
    log, warmer = pd.read_csv(tmp_path / "r.csv"), {"oil_temperature_c": {"channel": "T", "unit": "degC"}}
    log.assign(T=np.linspace(27.0, 48.0, len(log))).to_csv(tmp_path / "r.csv", index=False)
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump({"channels": CHANNELS | warmer}), encoding="utf-8")
    assert main([*given, "--generations", "1"]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"\ncondition 1: \d+ points of steady sliding, oil of 27 to 48 °C, ", f"\n{printed}")
    assert "LuGre: 1 recording of condition 1, oil of 27 to 48 °C, error " in printed
    content = json.loads((tmp_path / "out/friction_models.json").read_text(encoding="utf-8"))
    for found in (content["stribeck"]["1"], content["models"]["lugre"]):
        assert found["oil_temperature_c"] == pytest.approx([27.0, 48.0], abs=0.5)
    assert ", oil of 27 to 48 °C. " in (tmp_path / "out/friction_models.html").read_text(encoding="utf-8")
    assert "oil of 27 to 48 °C" in (tmp_path / "out/lugre.mo").read_text(encoding="utf-8")
    assert "viscous_n_s_m" in printed
    assert re.search(r"condition 1: \d+ points .* friction does not rise towards standstill; record slower", printed)
    assert printed.count("towards standstill") == 1
    for name in ("static_n", "stribeck_velocity_m_s", "stribeck_exponent"):
        assert f"{name:<22} not determined: steady sliding of condition 1 does not show it\n" in printed
    for name in ("coulomb_n", "retract_ratio"):
        assert f"{name:<22} not determined: the sensors' zeros are not stated, and strokes do not show" in printed
    assert "zeros    state how exact the sensors are (--sensor-class, or " in printed
    assert "\nintervals of 95 % hold the scatter of recordings like these" in printed
    assert "; unstated delays of sensors and errors of the model itself come on top\n" in printed
    assert "LuGre, pressure-scaled: not identified: the sum of both pressures" in printed
    assert f"page     {tmp_path}/out/friction_models.html" in printed
    assert 'parameter Real static_n(unit = "N") "Fs' in (tmp_path / "out/lugre.mo").read_text(encoding="utf-8")
    assert "friction.static_n = NaN; % [N] Fs" in (tmp_path / "out/lugre.m").read_text(encoding="utf-8")
    assert not (tmp_path / "out/pressure_lugre.mo").exists()


def test_json_and_status_of_a_failure(tmp_path: Path, cylinder: Cylinder, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*arguments(tmp_path, cylinder, [0.05, 0.06] * 6), "--json"]) == 1
    content = json.loads(capsys.readouterr().out)
    assert content["stribeck"]["1"]["oil_temperature_c"] is None
    assert set(content["models"]) == {"lugre", "pressure_lugre"}
    assert "a factor of 1;" in content["models"]["lugre"]["why_not"]
