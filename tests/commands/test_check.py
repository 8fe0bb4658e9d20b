"""What would fail after hours is refused before anything runs."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.stages._stage import LABELLED_FOLDER

PROJECT = Path(__file__).parents[2]


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh clone: configuration, but no data."""
    for name in ("conf", ".dvc/config", "dvc.yaml"):
        source, target = PROJECT / name, tmp_path / name
        target.parent.mkdir(exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copyfile)(source, target)
    subprocess.run(["git", "init", "--quiet", str(tmp_path)], check=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check(capsys: pytest.CaptureFixture[str], *overrides: str) -> str:
    """Return what the command says of a configuration; nothing if it accepts it."""
    if main(["params", *overrides]):
        return capsys.readouterr().err
    assert main(["check"]) in (0, 1)
    return capsys.readouterr().err


def test_the_shipped_configuration_passes_in_a_fresh_clone(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check(capsys) == ""
    assert check(capsys, "experiment=smoke") == ""
    assert check(capsys, "register.candidate=ridge") == ""


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("register.model_name='a/b'", "register.model_name: expected letters, digits, '_', '-' and '.'"),
        ("register.model_name='a:b'", "register.model_name: expected letters, digits, '_', '-' and '.'"),
        ("register.model_name=' '", "register.model_name: expected letters, digits, '_', '-' and '.'"),
        ("register.model_name=''", "register.model_name: expected letters, digits, '_', '-' and '.'"),
        ("search.space.nodes=[]", "search.space.nodes: "),
        (
            "register.candidate=lugre",
            "register.candidate: expected an estimator with a real-time step (force_balance_un",
        ),
        ("experiment=own", "ingest.source: data/raw/own holds no file that matches"),
    ],
)
def test_what_fails_only_after_hours_is_refused_by_name(
    project: Path, capsys: pytest.CaptureFixture[str], override: str, message: str
) -> None:
    assert message in check(capsys, override)


def test_conditions_are_those_of_the_configured_source_and_not_of_earlier_results(
    project: Path, capsys: pytest.CaptureFixture[str], labelled_recordings: list[Recording]
) -> None:
    for recording in labelled_recordings:  # conditions 1, 2, ... of the rig
        write_recording(LABELLED_FOLDER, recording)
    for session in ("no-load_monday", "heavy_monday"):
        (project / "data/raw/own" / session).mkdir(parents=True)
        (project / "data/raw/own" / session / "stroke_01.csv").touch()
    assert check(capsys, "experiment=own", "lugre.condition=no-load") == ""
    words = "lugre.condition: expected one of ['heavy', 'no-load'], which ingest.name_pattern finds in data/raw/own"
    assert f"{words}, but got '1'" in check(capsys, "experiment=own")
    assert check(capsys) == "", "the rig again"


def test_cuda_without_cuda_is_refused(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    assert "search.device: is 'cuda', but PyTorch finds no CUDA device; use 'auto' or 'cpu'" in check(
        capsys, "search.device=cuda"
    )


def test_a_downloaded_zip_learns_what_to_do(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(project / ".git")
    found = check(capsys)
    assert "this folder: DVC needs Git, which refuses (fatal: not a git repository" in found
    assert "run `git init`, or write `no_scm = true` below [core] in .dvc/config" in found
    config = project / ".dvc/config"
    config.write_text(config.read_text(encoding="utf-8").replace("[core]\n", "[core]\n    no_scm = true\n"), "utf-8")
    assert check(capsys) == ""


def test_a_git_that_refuses_is_quoted(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", "/dev/null")
    monkeypatch.setenv("GIT_CONFIG_SYSTEM", "/dev/null")
    assert "safe.directory" in check(capsys)


def test_own_logs_that_are_not_there_are_named_with_what_to_do(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["params", "experiment=own"]) == 0
    assert main(["code"]) == 1
    words = "data/raw/own (ingest.source): no such folder; put your logs there, each file where"
    assert words in capsys.readouterr().err
    (project / "data/raw/own").mkdir(parents=True)
    assert main(["code"]) == 0
    shutil.rmtree("data")
    assert main(["params"]) == 0
    assert main(["code"]) == 0, "the rig makes its own"
