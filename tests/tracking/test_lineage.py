"""The way back from a champion: every link, and every way to break one."""

import json
import marshal
import re
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from functools import partial
from importlib.util import MAGIC_NUMBER, cache_from_source
from pathlib import Path

import mlflow
import pytest
import yaml
from mlflow import MlflowClient

from candidates import registered_in
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking.lineage import Lineage, lineage
from cylinder_friction.tracking.model_folder import estimator_folder
from cylinder_friction.tracking.repository import LineageError, git
from cylinder_friction.tracking.store import tracking_uri
from cylinder_friction.tracking.versions import dvc_hash, locked_hashes, origin_of, where_data_lies

URI = "models:/friction-estimator@champion"
PROCESSED = [f"data/processed/{role}" for role in ("train", "validation", "test")]


@pytest.fixture
def registered(with_champion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    return Path(shutil.copytree(with_champion, tmp_path / "repository"))


def broken(found: Lineage) -> dict[str, str]:
    links = {link.name: link.found for link in found.links if not link.holds}
    assert found.holds == (not links)
    return links


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def commit_all(root: Path) -> None:
    author = ("-c", "user.name=Tester", "-c", "user.email=tester@localhost")
    subprocess.run(["git", "-C", str(root), *author, "commit", "-qam", "Later"], check=True)


def test_the_whole_way_back_holds_and_is_printed(registered: Path, tmp_path: Path) -> None:
    change(registered / "params.yaml", "tolerance_percent: 0.1", "tolerance_percent: 5.0")  # which shapes no model
    found = lineage(URI, registered)
    assert broken(found) == {}
    assert lineage("models:/friction-estimator/1", registered) == found
    folder, uri = estimator_folder(URI, registered, tmp_path)
    assert uri == "models:/friction-estimator/1"
    assert load_estimator(folder).inputs
    lines = found.text().splitlines()
    assert lines[0].startswith("friction-estimator version 1 (promoted: there is no incumbent")
    assert [line.split()[1] for line in lines[1:7]] == ["run", "run's", "git", "code", "model", "model's"]
    assert any("dvc.lock raw/rig" in line and ".dir in the working tree" in line for line in lines)
    assert lines[-1] == f"all {len(found.links) - 1} links hold; not checked: promotion"
    (unchecked,) = (line for line in lines if line.startswith("  ?"))
    assert re.search(r"promotion +promoted from none by \w+ at 20", unchecked), "nobody can check who, and when"


def test_a_model_that_was_served_is_unchanged(pipeline: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    registered_in(pipeline)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", tracking_uri(pipeline))
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    mlflow.pyfunc.load_model(URI)
    assert logged(pipeline, "registered_model_meta").is_file()
    assert list(pipeline.glob("mlartifacts/**/__pycache__/*.pyc")), "that of its own code, which is left out of account"
    assert lineage(URI, pipeline).holds


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("models:/friction-estimator@challenger", "has no such version"),
        ("models:/friction-estimator/7", "has no such version"),
        ("models:/other@champion", "has no such version"),
        ("friction-estimator", "names no registered model; expected models:/<name>@<alias>"),
    ],
)
def test_a_model_that_is_not_there_is_named(registered: Path, uri: str, message: str) -> None:
    with pytest.raises(LineageError, match=message):
        lineage(uri, registered)


@pytest.mark.parametrize("text", ["", "<<<<<<< ours\n=======\n{["])
def test_what_has_moved_on_or_cannot_be_read_now_is_found_in_the_history(registered: Path, text: str) -> None:
    for file, old, new in (("params.yaml", "seed: 1", "seed: 7"), ("dvc.lock", ".dir", "0.dir")):
        change(registered / file, old, new)
        if text:
            (registered / file).write_text(text, encoding="utf-8")
    commit_all(registered)
    found = lineage(URI, registered)
    assert found.holds
    assert sum("in commit" in link.found for link in found.links) == 1 + 4, "the parameters and four folders"


def test_parameters_that_no_commit_has_are_a_broken_link_that_names_them(registered: Path) -> None:
    shutil.rmtree(registered / ".git")
    (registered / ".dvc").mkdir()
    change(registered / "params.yaml", "seed: 1", "seed: 7")
    change(registered / "dvc.lock", "data/raw/rig", "data/raw/bench")
    links = broken(lineage(URI, registered))
    assert links["parameters"] == "record.seed was 1, is 7, and no commit has them as they were"
    assert links["git commit"].endswith("not in this repository; fetch the branch that holds it")
    assert "in no commit of dvc.lock" in links["dvc.lock raw/rig"]


def stored(root: Path, place: Path) -> Path:
    """Move the raw data into a store of DVC's; returns the log that is its content."""
    folder = root / "data/raw/rig"
    files = [{"md5": dvc_hash(file), "relpath": file.name} for file in sorted(folder.iterdir())]
    content = {dvc_hash(folder): json.dumps(files).encode(), files[0]["md5"]: (folder / "log.csv").read_bytes()}
    for md5, data in content.items():
        (place / "files/md5" / md5[:2]).mkdir(parents=True, exist_ok=True)
        (place / "files/md5" / md5[:2] / md5[2:]).write_bytes(data)
    shutil.rmtree(folder)
    return place / "files/md5" / files[0]["md5"][:2] / files[0]["md5"][2:]


def test_data_in_dvcs_cache_holds_and_is_read_to_the_last_byte(registered: Path) -> None:
    log = stored(registered, registered / ".dvc/cache")
    assert lineage(URI, registered).holds
    log.write_bytes(b"rotten")
    assert set(broken(lineage(URI, registered))) == {"data raw/rig"}


def test_data_on_a_remote_holds_without_being_pulled(registered: Path, tmp_path: Path) -> None:
    log = stored(registered, tmp_path / "shelf")
    (registered / ".dvc").mkdir(exist_ok=True)
    config = registered / ".dvc/config"
    config.write_text(f"['remote \"shelf\"']\n    url = {tmp_path / 'shelf'}\n", encoding="utf-8")
    found = {link.name: link for link in lineage(URI, registered).links}["data raw/rig"]
    assert (found.holds, found.found) == (True, "on DVC's remote 'shelf'")
    log.unlink()
    assert set(broken(lineage(URI, registered))) == {"data raw/rig"}
    config.write_text("['remote \"cloud\"']\n    url = gs://bucket\n", encoding="utf-8")
    links = broken(lineage(URI, registered))
    assert set(links) == {"data raw/rig"}
    assert "; DVC's remote 'cloud' cannot be read (" in links["data raw/rig"]


def logged(root: Path, name: str) -> Path:
    (path,) = root.glob(f"mlartifacts/models/*/artifacts/**/{name}")
    return path


def in_file(name: str, old: str, new: str) -> Callable[[Path], None]:
    return lambda root: change(logged(root, name), old, new)


def in_tag(key: str, value: str) -> Callable[[Path], None]:
    return lambda root: MlflowClient(tracking_uri(root)).set_model_version_tag("friction-estimator", "1", key, value)


def extra_byte(name: str) -> Callable[[Path], None]:
    return lambda root: logged(root, name).write_bytes(logged(root, name).read_bytes() + b"\0")


def commits_that_do_not_have_the_code(root: Path) -> None:
    change(root / "src/cylinder_friction/stages/train.py", "train", "other")
    author = ("-c", "user.name=Tester", "-c", "user.email=tester@localhost")
    subprocess.run(["git", "-C", str(root), *author, "commit", "-qa", "--amend", "-m", "Other"], check=True)
    sha = git(root, "rev-parse", "HEAD") or ""
    in_json_tag("lineage", "git_commit", sha)(root)
    for path in root.glob("mlartifacts/models/*/artifacts/**/lineage.json"):
        content = json.loads(path.read_text(encoding="utf-8"))
        path.write_text(json.dumps({**content, "sha": sha}), encoding="utf-8")


def in_json_tag(tag: str, key: str, value: object) -> Callable[[Path], None]:
    def tamper(root: Path) -> None:
        client = MlflowClient(tracking_uri(root))
        content = json.loads(client.get_model_version("friction-estimator", "1").tags[tag])
        assert content[key] != value
        in_tag(tag, json.dumps(content | {key: value}))(root)

    return tamper


def run_deleted(name: str) -> Callable[[Path], None]:
    def delete(root: Path) -> None:
        client = MlflowClient(tracking_uri(root))
        experiment = client.get_experiment_by_name("cylinder-friction")
        assert experiment is not None
        for run in client.search_runs([experiment.experiment_id], f"attributes.run_name = '{name}'"):
            client.delete_run(run.info.run_id)

    return delete


def model_swapped(root: Path) -> None:
    estimator = logged(root, "network.onnx").parent / "estimator.json"
    content = json.loads(estimator.read_text(encoding="utf-8"))
    content["parameters"]["target_mean_n"] += 100.0
    estimator.write_text(json.dumps(content), encoding="utf-8")
    in_tag("model_key", hash_of(estimator.parent))(root)


def foreign_bytecode(root: Path) -> None:
    """Let MLflow run something else than the model's code: bytecode whose source nobody looks at."""
    source = logged(root, "scoring_model.py")
    cached = Path(cache_from_source(str(source)))
    cached.parent.mkdir()
    code = marshal.dumps(compile("print('other code')", str(source), "exec"))
    cached.write_bytes(MAGIC_NUMBER + (1).to_bytes(4, "little") + bytes(8) + code)


def in_store(statement: str, *values: str) -> Callable[[Path], None]:
    def execute(root: Path) -> None:
        with closing(sqlite3.connect(root / "mlflow.db")) as database, database:
            assert database.execute(statement, values).rowcount

    return execute


def stored_elsewhere(root: Path) -> None:
    """Let the version's files be a copy with other code."""
    copy = shutil.copytree(logged(root, "MLmodel").parent, root / "elsewhere")
    change(next(copy.rglob("scoring.py")), "import", "import os\nimport")
    in_store("UPDATE model_versions SET storage_location = ?", copy.as_uri())(root)


def metric_changed(root: Path, name: str = "mae_n") -> None:
    client = MlflowClient(tracking_uri(root))
    client.log_metric(client.get_model_version("friction-estimator", "1").run_id or "", name, 0.1)


def written(name: str, text: str) -> Callable[[Path], object]:
    return lambda root: logged(root, name).write_text(text, encoding="utf-8")


def in_origin(key: str, value: object) -> Callable[[Path], None]:
    def tamper(root: Path) -> None:
        content = json.loads(logged(root, "lineage.json").read_text(encoding="utf-8"))
        assert key in content
        logged(root, "lineage.json").write_text(json.dumps(content | {key: value}), encoding="utf-8")

    return tamper


def code_in(name: str) -> Callable[[Path], None]:
    def write(root: Path) -> None:
        folder = logged(root, "MLmodel").parent / name
        folder.mkdir()
        (folder / "other.py").touch()

    return write


def logged_model_deleted(root: Path) -> None:
    MlflowClient(tracking_uri(root)).delete_logged_model(logged(root, "MLmodel").parents[1].name)


NO_ORIGIN = ("code", "tags", "parameters")


OTHER_RUN = "UPDATE model_versions SET run_id = (SELECT run_uuid FROM runs WHERE name = ?)"
HISTORY = "git commit"
TAMPERING: dict[str, tuple[Callable[[Path], object], set[str]]] = {
    "scoring code": (in_file("scoring.py", "import", "import os\nimport"), {"model's files"}),
    "ONNX": (extra_byte("network.onnx"), {"model", "model's files"}),
    "estimator.json": (extra_byte("estimator.json"), {"model", "model's files"}),
    "another estimator, its hash too": (model_swapped, {"model", "model's files", "tags"}),
    "a file added": (lambda root: (logged(root, "MLmodel").parent / "x.py").touch(), {"model's files"}),
    "lineage.json": (in_file("lineage.json", '"seed": 1', '"seed": 7'), {"model's files", "tags", "parameters"}),
    "tag content_sha256": (in_tag("content_sha256", "0" * 64), {"model's files"}),
    "tag model_key": (in_tag("model_key", "0" * 64), {"model", "tags"}),
    "tag git_commit": (in_json_tag("lineage", "git_commit", "0" * 40), {HISTORY, "tags"}),
    "tag of the raw data": (in_json_tag("lineage", "data", {"data/raw/rig": "other"}), {"tags"}),
    "tag of the figures": (in_json_tag("gate", "errors_percent", {"1": 0.1, "2": 0.1}), {"tags", "gate"}),
    "tag of the incumbent": (in_tag("gate_incumbent", '{"errors_percent": {"1": 9.0, "2": 9.0}}'), {"gate"}),
    "tag of the decision": (in_tag("gate_decision", "refused"), {"gate"}),
    "tag of the lineage, nested": (in_tag("lineage", "[" * 3000), {HISTORY, "tags"}),
    "tag of the candidate, a query": (in_tag("candidate_key", "x' or '1'='1"), {"tags", "gate"}),
    "MLmodel, empty": (written("MLmodel", ""), {"run", "model", "model's files", *NO_ORIGIN}),
    "lineage.json, its code a text": (in_origin("code", "x"), {"model's files", "code"}),
    "code among the bytecode": (code_in("__pycache__"), {"model's files"}),
    "a folder named as MLflow's own file": (code_in("registered_model_meta"), {"model's files"}),
    "the version's source": (in_store("UPDATE model_versions SET source = 'x'"), {"run", "model", "model's files"}),
    "the place is nowhere": (
        in_store("UPDATE model_versions SET storage_location = 'http://127.0.0.1:9/x'"),
        {"model", *NO_ORIGIN},
    ),
    "the logged model": (logged_model_deleted, {"run", "model", "model's files"}),
    "a metric added to the run": (partial(metric_changed, name="better_n"), {"run's figures"}),
    "a link to nothing in the data": (
        lambda root: (root / "data/raw/rig/link").symlink_to(root / "nowhere"),
        {"data raw/rig"},
    ),
    "bytecode": (foreign_bytecode, {"model's files"}),
    "where the version lies": (stored_elsewhere, {"model's files"}),
    "the version's run": (in_store(OTHER_RUN, "search"), {"run", "run's figures"}),
    "a metric of the run": (metric_changed, {"run's figures"}),
    "a digest of the run's data": (in_store("UPDATE datasets SET digest = ?", "f" * 36), {"run's figures"}),
    "run of train": (run_deleted("train"), {"run"}),
    "all files": (lambda root: shutil.rmtree(root / "mlartifacts"), {"model", "tags", "code", "parameters"}),
    "code in the commit": (commits_that_do_not_have_the_code, {"code", "model's files"}),
    "raw data": (lambda root: change(root / "data/raw/rig/log.csv", "10.5", "99.0"), {"data raw/rig"}),
}  # fmt: skip


@pytest.mark.parametrize("what", TAMPERING)
def test_tampering_is_a_broken_link(registered: Path, what: str) -> None:
    tamper, expected = TAMPERING[what]
    tamper(registered)
    assert set(broken(lineage(URI, registered))) == expected


def test_what_others_wrote_is_printed_on_one_line_without_commands_to_the_terminal(registered: Path) -> None:
    in_tag("promoted", "\x1b[2J\nall 99 links hold")(registered)
    found = lineage(URI, registered)
    assert len(found.text().splitlines()) == 1 + len(found.links) + 1
    assert r"promoted \u001b[2J\u000aall 99 links hold" in found.text()


def test_data_outside_the_project_is_not_looked_at(registered: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_text("time_s\n", encoding="utf-8")
    stated = f"{other} lies outside the project, whose data alone is looked at"
    assert where_data_lies(registered, str(other), dvc_hash(other)) == (False, stated)


def test_an_option_of_git_in_place_of_a_commit_writes_nothing(registered: Path) -> None:
    in_origin("sha", "--output=written")(registered)
    in_json_tag("lineage", "git_commit", "--output=written")(registered)
    assert {"git commit", "code"} <= set(broken(lineage(URI, registered)))
    assert not (registered / "written").exists()


def test_a_run_logged_later_has_the_commit_whose_code_ran(pipeline: Path) -> None:
    ran = git(pipeline, "rev-parse", "HEAD")
    change(pipeline / "src/cylinder_friction/stages/train.py", "train", "another")
    commit_all(pipeline)
    registered_in(pipeline)
    client = MlflowClient(tracking_uri(pipeline))
    version = client.get_model_version("friction-estimator", "1")
    stated = json.loads(version.tags["lineage"])
    assert (stated["git_commit"], stated["git_dirty"]) == (ran, False)
    tags = client.get_run(version.run_id or "").data.tags
    assert (tags["mlflow.source.git.commit"], tags["git_dirty"]) == (ran, "false")
    assert lineage(URI, pipeline).holds


def test_code_that_no_commit_has_breaks_the_way_back(pipeline: Path) -> None:
    path = pipeline / "reports/runs/train.json"
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), "code": "0" * 64}), encoding="utf-8")
    registered_in(pipeline)
    links = broken(lineage(URI, pipeline))
    assert links["git commit"] == "the code that ran is in no commit of this repository"
    assert links["code"] == "what record, search, train ran is not the code in commit unknown"


def test_outputs_have_the_last_word_in_dvc_lock() -> None:
    stages = {
        "ingest": {"deps": [{"path": "data/raw/rig/", "md5": "old"}, {"path": "logs", "md5": "own"}]},
        "record": {"outs": [{"path": "data/raw/rig", "md5": "new"}, {"path": "no_hash"}]},
    }
    assert locked_hashes(yaml.safe_dump({"stages": stages})) == {"data/raw/rig": "new", "logs": "own"}


def test_an_origin_that_dvc_does_not_know_is_refused(pipeline: Path) -> None:
    with pytest.raises(LineageError, match=r"dvc.lock: knows no output or dependency 'my/logs', but has \['data/"):
        origin_of(pipeline, "my/logs", PROCESSED)
    (pipeline / "dvc.lock").unlink()
    with pytest.raises(LineageError, match=r"dvc.lock: not there; run the pipeline with `dvc repro`"):
        origin_of(pipeline, "data/raw/rig", PROCESSED)


def test_hashes_are_those_of_dvc(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    for name, text in {"b.csv": "2", "a/z.csv": "1", "a-b.csv": "3", "a/é.csv": "4", "a.csv": "5"}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    for command in (["init", "--no-scm", "-q"], ["add", "-q", "data"]):
        subprocess.run([sys.executable, "-m", "dvc", *command], cwd=tmp_path, check=True, capture_output=True)
    written = yaml.safe_load((tmp_path / "data.dvc").read_text(encoding="utf-8"))
    assert dvc_hash(folder) == written["outs"][0]["md5"]
