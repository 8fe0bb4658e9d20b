"""``cylinder-friction export fmu``."""

from pathlib import Path

import pytest
from fmpy import read_model_description

from cylinder_friction.commands.cli import main
from cylinder_friction.deployment.c_export.compiled import NoCompilerError
from cylinder_friction.deployment.fmu import export
from cylinder_friction.estimators.hybrid import HybridEstimator


@pytest.fixture
def folder(small_hybrid: HybridEstimator, tmp_path: Path) -> Path:
    small_hybrid.save(tmp_path / "model")
    return tmp_path


@pytest.mark.parametrize(("options", "version"), [([], "2.0"), (["--fmi", "2"], "2.0"), (["--fmi", "3"], "3.0")])
def test_it_writes_the_file_and_says_what_is_in_it(
    folder: Path, options: list[str], version: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:

    def without_compiler() -> str:
        raise NoCompilerError("none here")

    monkeypatch.setattr(export, "find_compiler", without_compiler)
    path = folder / "press.fmu"
    assert main(["export", "fmu", str(folder / "model"), "--output", str(path), *options]) == 0
    description = read_model_description(str(path))
    assert description.fmiVersion == version
    said = capsys.readouterr().out
    assert said.startswith(f"{path}: sources only: no C compiler")
    assert said.endswith(f"model    press {description.guid}\n")


def test_a_wrong_name_and_a_missing_model_are_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "fmu", str(folder / "model"), "--output", str(folder / "press.zip")]) == 1
    assert "cylinder-friction export fmu: expected a file whose name ends in .fmu" in capsys.readouterr().err
    assert main(["export", "fmu", str(folder / "nothing"), "--output", str(folder / "press.fmu")]) == 1
    assert "holds no estimator.json" in capsys.readouterr().err
    assert not (folder / "press.fmu").exists()
