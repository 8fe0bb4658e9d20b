"""The guide's program compiles without a warning and runs; the command writes what it compiles."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.testing.golden import MODEL_FOLDER
from golden_fixtures import GOLDEN

GUIDE = Path(__file__).parents[3] / "docs/c.md"
PROGRAM = re.compile(r"^```c complete file=main\.c\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^```bash compile\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def only(pattern: re.Pattern[str]) -> str:
    (found,) = pattern.findall(GUIDE.read_text(encoding="utf-8"))
    return str(found)


def test_the_guides_program_runs(golden_model: StepModel, trajectories: dict[str, np.ndarray], tmp_path: Path) -> None:
    command = only(COMMAND).split()
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed")
    assert main(["export", "c", str(GOLDEN / MODEL_FOLDER), "--output", str(tmp_path)]) == 0
    (tmp_path / "main.c").write_text(only(PROGRAM), encoding="utf-8")
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    subprocess.run([*command, *strict], cwd=tmp_path, check=True)
    samples = trajectories["stick_slip_reversals"][:400].copy()
    samples[100, 0] = np.nan
    lines = "".join(f"{p1!r},{p2!r},{x!r}\n" for p1, p2, x in samples.tolist())
    done = subprocess.run([tmp_path / command[-2]], input=lines, capture_output=True, text=True, check=True)

    stream = RealTimeStream(golden_model)
    stream.warm_up(*samples[0].tolist(), steps=golden_model.guard.warm_up_samples)
    expected = [stream.step(*sample) for sample in samples.tolist()]
    rows = [line.split(",") for line in done.stdout.splitlines()]
    assert [int(row[3]) for row in rows] == [estimate.flags for estimate in expected]
    np.testing.assert_allclose([float(row[0]) for row in rows], [each.friction_n for each in expected], atol=1e-3)
    assert rows[100][4] == "a sensor fails"
    assert expected[100].flags & Flag.INVALID_PRESSURE_1
    assert "one step every 0.005 s" in done.stderr


def test_the_command_says_what_it_wrote(
    small_hybrid: HybridEstimator, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small_hybrid.save(tmp_path / "model")
    arguments = ["export", "c", str(tmp_path / "model"), "--output", str(tmp_path / "out"), "--name", "press"]
    assert main([*arguments, "--precision", "float", "--model", "lstm"]) == 0
    said = capsys.readouterr().out
    header = (tmp_path / "out/press.h").read_text(encoding="utf-8")
    assert f"{tmp_path / 'out/press.c'}: " in said
    assert '#define PRESS_PRECISION "float"' in header
    assert '#define PRESS_KIND "hybrid, lstm alone"' in header
    assert re.search(r'#define PRESS_MODEL "(\w{64})"', header)[1] in said
    assert re.search(r"#define PRESS_STATE_BYTES (\d+)", header)[1] in said


@pytest.mark.parametrize("what", ["c", "fmu"])
def test_a_model_that_is_not_there_is_named(what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", what, str(tmp_path), "--output", str(tmp_path / "out.fmu")]) == 1
    assert f"export {what}: " in (said := capsys.readouterr().err)
    assert "holds no estimator.json" in said
    assert list(tmp_path.iterdir()) == []
