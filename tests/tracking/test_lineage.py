"""The way back from a champion: every link, and every way to break one."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mlflow
import pytest
import yaml
from mlflow import MlflowClient

from candidates import registered_in
from copied_stores import copied
from cylinder_friction.dvc_hashes import data_hashes, dvc_hash, locked_hashes
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.tracking.lineage import Lineage, estimator_folder, lineage
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import tracking_uri

URI = "models:/friction-estimator@champion"


@pytest.fixture
def registered(with_champion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    return copied(with_champion, tmp_path / "repository")


def broken(found: Lineage) -> dict[str, str]:
    links = {name: words for name, (holds, words) in found.links.items() if not holds}
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
    assert list(found.links) == ["files", "run", "git commit", *sorted(DATA), "parameters"]
    head = found.links["git commit"][1]
    assert head.endswith(f"Pipeline; HEAD is {head[:12]}, with the same code")
    assert any("data raw/rig" in line and line.endswith(".dir in dvc.lock of the working tree") for line in lines)
    place = next((registered / "mlartifacts" / "models").iterdir()).as_uri()
    assert lines[-1] == f"all 8 links hold for the files at {place}/artifacts"


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
        ("models:/friction-estimator@challenger", "has no such version .*; it has versions 1: name one"),
        ("models:/friction-estimator/7", "`cylinder-friction promote VERSION friction-estimator` makes"),
        ("models:/other@champion", "run `dvc repro` or, if it has nothing left to run, `cylinder-friction"),
        ("friction-estimator", "names no registered model; expected models:/<name>@<alias>"),
    ],
)
def test_a_model_that_is_not_there_is_named(registered: Path, uri: str, message: str) -> None:
    with pytest.raises(TrackingError, match=message):
        lineage(uri, registered)


@pytest.mark.parametrize("text", ["", "<<<<<<< ours\n=======\n{["])
def test_what_has_moved_on_or_cannot_be_read_now_is_found_in_the_history(registered: Path, text: str) -> None:
    for file, old, new in (("params.yaml", "seed: 1", "seed: 7"), ("dvc.lock", ".dir", "0.dir")):
        change(registered / file, old, new)
        if text:
            (registered / file).write_text(text, encoding="utf-8")
    (registered / "src/train.py").write_text("NAME = 'other'\n", encoding="utf-8")
    commit_all(registered)
    found = lineage(URI, registered)
    assert found.holds
    made = found.links["git commit"][1]
    assert made.endswith("with other code")
    for name in DATA:
        assert found.links[name][1].endswith(f" in dvc.lock of commit {made[:7]}")
    assert found.links["parameters"][1].endswith(f" in params.yaml of commit {made[:7]}")


def test_what_no_commit_has_is_a_broken_link(registered: Path) -> None:
    shutil.rmtree(registered / ".git")
    (registered / ".dvc").mkdir()
    change(registered / "params.yaml", "seed: 1", "seed: 7")
    change(registered / "dvc.lock", ".dir", "0.dir")
    links = broken(lineage(URI, registered))
    assert "not in this repository (fatal: not a git repository" in links["git commit"]
    assert links["parameters"].endswith("in no version of params.yaml; fetch the branch that holds it")
    assert links["data raw/rig"].endswith("in no version of dvc.lock; fetch the branch that holds it")


def test_a_model_made_without_git_has_a_lineage_that_says_so(pipeline: Path) -> None:
    shutil.rmtree(pipeline / ".git")
    (pipeline / ".dvc").mkdir()
    registered_in(pipeline)
    links = broken(lineage(URI, pipeline))
    assert set(links) == {"git commit"}
    assert links["git commit"].startswith("unknown when the model was made: fatal: not a git repository")


def logged(root: Path, name: str) -> Path:
    (path,) = root.glob(f"mlartifacts/models/*/artifacts/**/{name}")
    return path


def in_file(name: str, old: str, new: str) -> Callable[[Path], None]:
    return lambda root: change(logged(root, name), old, new)


def in_tag(key: str, value: str) -> Callable[[Path], None]:
    return lambda root: MlflowClient(tracking_uri(root)).set_model_version_tag("friction-estimator", "1", key, value)


def extra_byte(name: str) -> Callable[[Path], None]:
    return lambda root: logged(root, name).write_bytes(logged(root, name).read_bytes() + b"\0")


def run_deleted(root: Path) -> None:
    client = MlflowClient(tracking_uri(root))
    client.delete_run(client.get_model_version("friction-estimator", "1").run_id or "")


def in_origin(key: str, value: object) -> Callable[[Path], None]:
    def tamper(root: Path) -> None:
        content = json.loads(logged(root, "lineage.json").read_text(encoding="utf-8"))
        assert key in content
        logged(root, "lineage.json").write_text(json.dumps(content | {key: value}), encoding="utf-8")

    return tamper


DATA = ("data raw/rig", "data processed/train", "data processed/validation", "data processed/test")
TAMPERING: dict[str, tuple[Callable[[Path], object], set[str]]] = {
    "scoring code": (in_file("scoring.py", "import", "import os\nimport"), {"files"}),
    "ONNX": (extra_byte("network.onnx"), {"files"}),
    "a file added": (lambda root: (logged(root, "MLmodel").parent / "x.py").touch(), {"files"}),
    "lineage.json": (in_file("lineage.json", '"git_dirty": "false"', '"git_dirty": "true"'), {"files"}),
    "MLmodel, empty": (lambda root: logged(root, "MLmodel").write_text("", "utf-8"), {"files"}),
    "lineage.json, another commit": (in_origin("git_commit", "0" * 40), {"files", "git commit"}),
    "lineage.json, an option of git's": (in_origin("git_commit", "--output=written"), {"files", "git commit"}),
    "lineage.json, other data": (in_origin("data", {"data/raw/rig": "0" * 32}), {"files", "data raw/rig"}),
    "lineage.json, other parameters": (in_origin("params", {"train": {"seed": 7}}), {"files", "parameters"}),
    "tag of the files": (in_tag("hash_files", "0" * 64), {"files"}),
    "the run": (run_deleted, {"run"}),
    "all files": (lambda root: shutil.rmtree(root / "mlartifacts"), {"files"}),
    "lineage.json, cut off": (lambda root: logged(root, "lineage.json").write_text("{", "utf-8"), {"files"}),
}  # fmt: skip


@pytest.mark.parametrize("what", TAMPERING)
def test_tampering_is_a_broken_link(registered: Path, what: str) -> None:
    tamper, expected = TAMPERING[what]
    tamper(registered)
    assert set(broken(lineage(URI, registered))) == expected


def test_what_others_wrote_is_printed_on_one_line_without_commands_to_the_terminal(registered: Path) -> None:
    in_tag("reason", "\x1b[2J\nall 99 links hold")(registered)
    found = lineage(URI, registered)
    assert len(found.text().splitlines()) == 1 + len(found.links) + 1
    assert r"\u001b[2J\u000aall 99 links hold" in found.text()


def test_outputs_have_the_last_word_in_dvc_lock() -> None:
    stages = {
        "ingest": {"deps": [{"path": "data/raw/rig/", "md5": "old"}, {"path": "logs", "md5": "own"}]},
        "record": {"outs": [{"path": "data/raw/rig", "md5": "new"}, {"path": "no_hash"}]},
    }
    assert locked_hashes(yaml.safe_dump({"stages": stages})) == {"data/raw/rig": "new", "logs": "own"}


def test_data_that_dvc_does_not_know_is_refused(pipeline: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(pipeline)
    with pytest.raises(RecordingError, match=r"dvc.lock: knows no output or dependency 'my/logs', but has \['data/"):
        data_hashes(["my/logs"])
    (pipeline / "dvc.lock").unlink()
    with pytest.raises(RecordingError, match=r"but has \[\]; run the pipeline with `dvc repro`"):
        data_hashes(["data/raw/rig"])


def test_hashes_are_those_of_dvc(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    for name, text in {"b.csv": "2", "a/z.csv": "1", "a-b.csv": "3", "a/é.csv": "4", "a.csv": "5"}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    for command in (["init", "--no-scm", "-q"], ["add", "-q", "data"]):
        subprocess.run([sys.executable, "-m", "dvc", *command], cwd=tmp_path, check=True, capture_output=True)
    written = yaml.safe_load((tmp_path / "data.dvc").read_text(encoding="utf-8"))
    assert dvc_hash(folder) == written["outs"][0]["md5"]
