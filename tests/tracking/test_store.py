"""Where runs go: one place a repository, whoever writes and from wherever."""

import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from alembic import command
from mlflow.store.db.utils import _get_alembic_config

from candidates import champion, registered_in
from copied_stores import copied
from cylinder_friction.commands.cli import main
from cylinder_friction.tracking.lineage import lineage
from cylinder_friction.tracking.registry import move_champion, track
from cylinder_friction.tracking.repository import TrackingError, commit_of, repository_root
from cylinder_friction.tracking.store import EXPERIMENT, open_store, tracking_uri

WRITERS = """
import os, sys
from pathlib import Path
import mlflow.store.tracking.sqlalchemy_store
from cylinder_friction.tracking.log_run import log_run
from cylinder_friction.run_record import RunRecord

started = []
for _ in range(2):  # at the same moment, and what they import is imported once
    started.append(os.fork())
    if not started[-1]:
        for number in range(3):
            log_run(RunRecord("label", metrics={"number": number + 3.0 * len(started)}), Path(sys.argv[1]))
        os._exit(0)
assert [os.waitpid(writer, 0)[1] for writer in started] == [0, 0]
"""


def test_the_default_is_sqlite_at_the_root_by_absolute_path(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = root / "data" / "raw"
    inside.mkdir(parents=True)
    monkeypatch.chdir(inside)
    assert tracking_uri(inside) == f"sqlite:///{root}/mlflow.db"
    with open_store(inside) as store:
        experiment = store.client.get_experiment_by_name(EXPERIMENT)
        assert experiment is not None
        assert experiment.artifact_location == f"file://{root}/mlartifacts"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://tracking:5000")
    assert tracking_uri(root) == "http://tracking:5000"


@pytest.mark.parametrize("how", [shutil.move, shutil.copytree])
def test_a_repository_that_was_moved_or_copied_writes_to_no_other_one(
    pipeline: Path, tmp_path: Path, how: Callable[[Path, Path], object]
) -> None:
    registered_in(pipeline)
    there = tmp_path / "elsewhere"
    how(pipeline, there)
    with pytest.raises(TrackingError) as refused, open_store(there):
        pass
    artifacts = pipeline.as_uri() + "/mlartifacts"
    assert f"(the repository was moved or copied from {artifacts}); move it away" in str(refused.value)
    if how is shutil.copytree:
        assert f"for the files at {artifacts}" in lineage("models:/friction-estimator@champion", there).text()
    new = tmp_path / "new"
    shutil.copytree(there, new, ignore=shutil.ignore_patterns("mlflow.db", "mlartifacts"))
    track(new)
    move_champion(new, "friction-estimator", 1)
    found = lineage("models:/friction-estimator@champion", new)
    assert found.holds, found.text()
    assert len(list(new.glob("mlartifacts/models/*"))) == 1


COMMANDS = (["serve", "--port", "0"], ["lineage"], ["rollback"], ["promote", "1"], ["ui"])


@pytest.mark.parametrize("files", [["params.yaml"], ["mlflow.db", "params.yaml"]])
@pytest.mark.parametrize("command", COMMANDS)
def test_what_only_reads_makes_no_store_and_fills_no_empty_file(
    files: list[str],
    command: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.chdir(tmp_path)
    for name in files:
        (tmp_path / name).touch()
    shutil.copy(Path(__file__).parents[2] / "params.yaml", tmp_path)
    assert main(command) == 1
    error = capfd.readouterr().err
    assert "mlflow.db: there is no such store, or an empty file; run `dvc repro`, or `cylinder-friction track`" in error
    assert error.count("\n") == 1 + (command[0] in ("serve", "ui"))  # which say first that they start
    filled = {path.name: path.stat().st_size > 0 for path in tmp_path.iterdir()}
    assert filled == {name: name == "params.yaml" for name in files}


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("./mlruns", "is no MLflow store that can be opened (The filesystem tracking backend"),
        ("postgresql+nodriver://localhost/x", "is no MLflow store that can be opened ("),
        ("server", "is no MLflow store that can be opened ("),
        ("file", "is no MLflow store that can be opened ("),
    ],
)
def test_a_wrong_store_is_refused_in_a_sentence(
    uri: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "text.db").write_text("no database " * 100, encoding="utf-8")
    with ThreadingHTTPServer(("127.0.0.1", 0), SimpleHTTPRequestHandler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        places = {"server": f"http://127.0.0.1:{server.server_port}", "file": f"sqlite:///{tmp_path / 'text.db'}"}
        monkeypatch.setenv("MLFLOW_TRACKING_URI", places.get(uri, uri))
        with pytest.raises(TrackingError) as refused, open_store(tmp_path, create=False):
            pass
        server.shutdown()
    assert message in str(refused.value)
    assert "to use the repository's own store" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_experiment_in_dvcs_throw_away_folder_writes_to_the_real_repository(root: Path) -> None:
    temporary = root / ".dvc/tmp/exps/tmpab12"
    (temporary / ".git").mkdir(parents=True)
    (temporary / "reports").mkdir()
    assert repository_root(temporary / "reports") == root
    assert repository_root(root.parent) == root.parent, "outside any repository it is the folder itself"


@pytest.mark.extended
def test_many_processes_share_a_store_that_none_has_made_yet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    assert subprocess.run([sys.executable, "-c", WRITERS, str(tmp_path)], timeout=600, check=False).returncode == 0
    with open_store(tmp_path) as store:
        runs = store.client.search_runs([store.experiment()], "tags.stage = 'label'")
        assert sorted(run.data.metrics["number"] for run in runs) == [3.0, 4.0, 5.0, 6.0, 7.0, 8.0]


@pytest.mark.extended
@pytest.mark.parametrize("lives_s", [2.0, 3.0, 4.0, 6.0])
def test_a_store_is_made_whole_or_not_at_all_when_its_maker_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lives_s: float
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    command = "from pathlib import Path; from cylinder_friction.tracking.store import open_store\n"
    command += f"with open_store(Path({str(tmp_path)!r})): pass"
    maker = subprocess.Popen([sys.executable, "-c", command], cwd=tmp_path)
    with suppress(subprocess.TimeoutExpired):
        maker.wait(lives_s)
    maker.kill()
    maker.wait()
    with open_store(tmp_path) as store:
        assert store.client.get_experiment_by_name("cylinder-friction") is not None


def test_only_changes_of_sources_make_a_commit_dirty(pipeline: Path) -> None:
    clean = commit_of(pipeline)
    assert len(clean["git_commit"]) == 40
    assert clean["git_dirty"] == "false"
    for written in ("dvc.lock", "metrics.json", "params.yaml", "code.yaml", "notes.txt"):
        (pipeline / written).write_text("{}", encoding="utf-8")
    assert commit_of(pipeline) == clean
    (pipeline / "src/train.py").write_text("NAME = 'other'", encoding="utf-8")
    assert commit_of(pipeline) == {**clean, "git_dirty": "true"}


def test_a_git_that_refuses_is_named_as_that(pipeline: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", "/dev/null")
    monkeypatch.setenv("GIT_CONFIG_SYSTEM", "/dev/null")
    found = commit_of(pipeline)
    assert found["git_commit"] == "unknown"
    assert "dubious ownership" in found["git_problem"]
    assert "safe.directory" in found["git_problem"]


def test_a_damaged_own_store_is_not_blamed_on_a_variable(root: Path) -> None:
    (root / "mlflow.db").write_text("no database " * 100, encoding="utf-8")
    with pytest.raises(TrackingError) as found, open_store(root):
        pass
    assert "move it away, and `cylinder-friction track` makes one from the res" in str(found.value)
    assert "MLFLOW_TRACKING_URI" not in str(found.value)


def test_a_store_of_an_older_mlflow_opens_and_keeps_the_champion(
    with_champion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    root = copied(with_champion, tmp_path / "repository")
    command.downgrade(_get_alembic_config(tracking_uri(root)), "-1")
    assert lineage("models:/friction-estimator@champion", root).holds


def test_a_store_of_a_newer_mlflow_is_not_to_be_moved_away(
    with_champion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    root = copied(with_champion, tmp_path / "repository")

    def made_by(schema: str) -> str:
        with closing(sqlite3.connect(root / "mlflow.db")) as database, database:
            (before,) = database.execute("SELECT version_num FROM alembic_version").fetchone()
            database.execute("UPDATE alembic_version SET version_num = ?", (schema,))
        return str(before)

    ours = made_by("f00d00000000")
    with pytest.raises(TrackingError) as found:
        lineage("models:/friction-estimator@champion", root)
    assert "another version of MLflow made it; if that was newer, install it" in str(found.value)
    assert f"run `mlflow db upgrade {tracking_uri(root)}`" in str(found.value)
    assert "move it away" not in str(found.value)
    made_by(ours)  # as with that version installed
    assert champion(root) == "1"
