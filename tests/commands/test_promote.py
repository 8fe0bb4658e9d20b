"""Promoting and going back by command."""

import shutil
from pathlib import Path

import pytest

from candidates import NAME, champion, other_model, registered_in
from cylinder_friction.commands.cli import main


def test_a_version_is_promoted_and_rolled_back_by_number(
    written_pipeline: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    root = Path(shutil.copytree(written_pipeline, tmp_path / "repository"))
    registered_in(root)
    other_model(root)
    assert not registered_in(root, {"1": 3.0, "2": 3.0}).promote
    monkeypatch.chdir(root)
    assert main(["promote", "2", NAME]) == 0
    assert capsys.readouterr().out == "friction-estimator: champion was version 1, is version 2\n"
    assert champion(root) == "2"
    assert main(["rollback", NAME]) == 0
    assert champion(root) == "1"
    assert main(["promote", "7", NAME]) == 1
    assert "there is no version 7; name one of its versions, `cylinder-friction promote VERSION`: 1, 2" in (
        capsys.readouterr().err
    )
