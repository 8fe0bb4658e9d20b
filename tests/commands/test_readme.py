"""The README's table and picture: the default's alone, and whole or not at all."""

from __future__ import annotations

import json
import resource
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.commands.readme import BEGIN, END, PICTURES
from cylinder_friction.run_record import RunRecord

PICTURE = Path(next(iter(PICTURES.values())))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose README shows earlier results, and new results beside it."""
    (tmp_path / "reports/figures").mkdir(parents=True)
    (tmp_path / "reports/runs").mkdir()
    (tmp_path / "reports/table.md").write_text("| Hybrid | 1.41 % |\n", encoding="utf-8")
    for source, target in PICTURES.items():
        (tmp_path / "reports/figures" / source).write_bytes(b"new" * 30_000)
        (tmp_path / target).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / target).write_bytes(b"old")
    (tmp_path / "README.md").write_text(f"# Title\n{BEGIN}\nold\n{END}\nrest\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def of_recipe(root: Path, experiment: str) -> None:
    record = RunRecord("compare", experiment=experiment)
    (root / "reports/runs/compare.json").write_text(json.dumps(record.to_dict()), encoding="utf-8")


def test_the_default_recipe_is_shown_without_a_word(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    of_recipe(project, "")
    assert main(["readme"]) == 0
    assert capsys.readouterr().out == ""
    assert (project / "README.md").read_text(encoding="utf-8") == (
        f"# Title\n{BEGIN}\n\n| Hybrid | 1.41 % |\n\n{END}\nrest\n"
    )
    assert (project / PICTURE).read_bytes() == b"new" * 30_000


def test_another_recipe_is_named(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    of_recipe(project, "smoke")
    assert main(["readme"]) == 0
    printed = capsys.readouterr().out
    assert "README.md now shows the recipe 'smoke', not the default" in printed
    assert "run `make params`, `dvc repro` and this command again" in printed


def test_a_full_disk_leaves_the_earlier_picture_and_table(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, hard))  # of bytes in a file: as if the disk were full then
    try:
        status = main(["readme"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert status == 1
    assert "File too large" in capsys.readouterr().err
    assert (project / PICTURE).read_bytes() == b"old"
    assert "old" in (project / "README.md").read_text(encoding="utf-8")
    assert [path.name for path in (project / PICTURE).parent.iterdir()] == [PICTURE.name], "no draft stays"
