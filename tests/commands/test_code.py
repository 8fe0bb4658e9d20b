"""The command ``code``: what it refuses before the pipeline begins."""

import shutil
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import main

ROOT = Path(__file__).parents[2]


def test_own_logs_that_are_not_there_are_named_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "conf", "conf")
    shutil.copy(ROOT / "dvc.yaml", ".")
    assert main(["params", "experiment=own"]) == 0
    assert main(["code"]) == 1
    assert (
        "data/raw/own (ingest.source): no such folder; put your logs there, each file where" in capsys.readouterr().err
    )
    Path("data/raw/own").mkdir(parents=True)
    assert main(["code"]) == 0
    shutil.rmtree("data")
    assert main(["params"]) == 0
    assert main(["code"]) == 0, "the rig makes its own"
