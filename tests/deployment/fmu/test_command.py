"""``cylinder-friction export fmu``."""

from pathlib import Path

import pytest
from fmpy import read_model_description

from cylinder_friction.commands.cli import main
from cylinder_friction.estimators.hybrid import HybridEstimator


@pytest.mark.parametrize(("options", "version"), [([], "2.0"), (["--fmi", "3"], "3.0")])
def test_it_writes_the_file_and_says_what_is_in_it(
    options: list[str],
    version: str,
    small_hybrid: HybridEstimator,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    small_hybrid.save(tmp_path / "model")
    path, command = tmp_path / "press.fmu", ["export", "fmu", str(tmp_path / "model"), "--output"]
    assert main([*command, str(path), *options]) == 0
    description = read_model_description(str(path))
    assert description.fmiVersion == version
    said = capsys.readouterr().out
    assert said.startswith(f"{path}: ")
    assert said.endswith(f"model    press {description.guid}\n")
    assert main([*command, str(tmp_path / "press.zip")]) == 1
    assert "cylinder-friction export fmu: expected a file whose name ends in .fmu" in capsys.readouterr().err
