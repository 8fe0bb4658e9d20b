"""A project's folder: what ``init`` puts into it, what its stages depend on, and what commands need outside of one."""

from __future__ import annotations

import errno
from pathlib import Path
from unittest.mock import Mock

import pytest
import yaml

from cylinder_friction.commands import init
from cylinder_friction.commands.cli import main
from cylinder_friction.commands.init import EXAMPLE
from cylinder_friction.import_graph import code_key
from cylinder_friction.run_record import STAGES
from cylinder_friction.tracking.repository import asked_git

CHECKOUT = Path(__file__).parents[2]
NO_CYLINDER = (
    "which cylinder? Give its dimensions, for example --cylinder bore_diameter_m=0.063,rod_diameter_m=0.028,"
    "stroke_m=0.25,moving_mass_kg=6, or a YAML file with these keys; there is no params.yaml in HERE to take them "
    "from\n"
)
IN_A_PROJECT = "run this in a project's folder, which `cylinder-friction init FOLDER` makes\n"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "project"
    assert main(["init", str(folder)]) == 0
    return folder


def test_a_project_holds_what_its_pipeline_and_its_user_need(project: Path) -> None:
    for name in ("conf/config.yaml", "params.yaml", "dvc.yaml"):
        assert (project / name).read_bytes() == (CHECKOUT / name).read_bytes()
    assert asked_git(project, "check-ignore", "code.yaml")[0] is None, "the hashes of its code are committed"
    assert {".dvc", ".dvcignore", ".git", ".gitignore"} <= {path.name for path in project.iterdir()}
    readme = (project / "README.md").read_text(encoding="utf-8")
    assert len([line for line in readme.splitlines() if line]) <= 10
    assert asked_git(project, "status", "--porcelain", "--", "README.md")[0] == "?? README.md"


def test_code_yaml_holds_the_hash_of_every_stage(project: Path) -> None:
    codes = yaml.safe_load((project / "code.yaml").read_text(encoding="utf-8"))
    assert codes.pop("cylinder-friction")
    assert codes == {stage: code_key(f"cylinder_friction.stages.{stage}") for stage in STAGES}


def test_the_example_log_gives_friction(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(project)
    mapping = ["--channels", "conf/ingest/rig.yaml", "--format", "csv"]
    assert main(["estimate", EXAMPLE, *mapping, "--output", str(tmp_path / "friction")]) == 0
    assert "friction 3" in capsys.readouterr().out  # 3xx N
    assert list(tmp_path.glob("friction/*.csv"))


def test_without_git_dvc_is_told_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["init", str(tmp_path / "project")]) == 0
    assert "[core]\n    no_scm = true\n" in (tmp_path / "project/.dvc/config").read_text(encoding="utf-8")


def test_a_full_disk_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    full = Mock(side_effect=OSError(errno.ENOSPC, "No space left on device"))
    monkeypatch.setattr(init, "write_logger_csv", full)
    assert main(["init", str(tmp_path / "project")]) == 1
    assert "init: no space left on device; make room, then run the same command again" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_folder_with_something_in_it_is_left_alone(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (project / "code.yaml").stat().st_mtime_ns
    assert main(["init", str(project)]) == 1
    assert f"{project}: there is something already; name a new folder, or an empty one" in capsys.readouterr().err
    assert (project / "code.yaml").stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("params", f"HERE/conf: no such folder; {IN_A_PROJECT}"),
        ("inspect log.csv ingest=own", f"HERE/conf: no such folder; {IN_A_PROJECT}"),
        ("inspect log.csv", NO_CYLINDER),
        ("check", f"HERE/params.yaml: not there; {IN_A_PROJECT}"),
        ("code", f"HERE/dvc.yaml: not there; {IN_A_PROJECT}"),
        ("stage record", f"HERE/params.yaml: not there; {IN_A_PROJECT}"),
        ("lineage", f"HERE/params.yaml: not there; {IN_A_PROJECT}"),
        ("rollback", f"HERE/params.yaml: not there; {IN_A_PROJECT}"),
        ("serve --port 0", f"HERE/params.yaml: not there; {IN_A_PROJECT}"),
        ("estimate log.csv", NO_CYLINDER),
        ("identify log.csv", NO_CYLINDER),
        ("summary", "HERE/reports/table.md: not there; run `dvc repro` first in a project's folder\n"),
        ("readme", "HERE/reports/table.md: not there; run `dvc repro` first\n"),
        ("track", "holds no run; run `dvc pull` or `dvc repro` first\n"),
        ("ui", "run `dvc repro`, or `cylinder-friction track` if the results are there already"),
        ("export c models/hybrid --output c", "models/hybrid: holds no estimator.json; expected a folder that `save`"),
    ],
)
def test_outside_a_project_a_command_names_what_it_needs_in_one_line(
    command: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    (tmp_path / "log.csv").write_text("Time [s],P1 [bar],P2 [bar],Position [mm]\n0.0,1,1,1\n", encoding="utf-8")
    assert main(command.split()) == 1
    printed = capfd.readouterr().err
    assert words.replace("HERE", str(tmp_path)) in printed
    starts = command.startswith(("serve", "ui"))  # which say at once that they start a server
    assert printed.count("\n") == 1 + starts
