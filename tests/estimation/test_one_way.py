"""One way for a log: opened to hash it, to look at it and to read it; parsed once; few modules on the way."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from logger_files import made_log

TRACED = Path(__file__).parents[1] / "traced_estimate.py"
CYLINDER = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6.0"
NAMES = {"t": "Time [s]", "p1": "P_A [bar]", "p2": "P_B [bar]", "x": "Position [mm]"}
COUNTED = ("modules", "opened", "parsed")
OPENED, PARSED, MODULES = 3, 1, 52


def test_a_log_is_read_once_and_straight_through(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "stroke.csv"
    made_log(12_000).rename(columns=NAMES).to_csv(log, index=False)
    command = [sys.executable, str(TRACED), str(log), str(tmp_path / "out"), "--cylinder", CYLINDER]
    subprocess.run(command, check=True, capture_output=True)
    found = json.loads((tmp_path / "out/traced.json").read_text(encoding="utf-8"))
    with capsys.disabled():
        sys.stdout.write(
            "{modules} modules, {opened} opens, {parsed} parses".format(**{k: len(found[k]) for k in COUNTED})
        )
    assert found["status"] == 0
    assert len(found["opened"]) <= OPENED, found["opened"]
    assert len(found["parsed"]) <= PARSED
    assert len(found["modules"]) <= MODULES, found["modules"]
