"""The way back from a champion: every link, and every way to break one."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
import yaml
from mlflow import MlflowClient

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.lineage import Lineage, lineage
from cylinder_friction.tracking.registry import register
from cylinder_friction.tracking.repository import LineageError
from cylinder_friction.tracking.store import tracking_uri
from cylinder_friction.tracking.versions import dvc_hash, locked_hashes, origin_of

if TYPE_CHECKING:
    from pathlib import Path

URI = "models:/friction-estimator@champion"
PROCESSED = [f"data/processed/{role}" for role in ("train", "validation", "test")]


@pytest.fixture
def registered(pipeline: Path) -> Path:
    candidate = Candidate(
        "friction-estimator",
        "models/hybrid",
        hash_of(pipeline / "models/hybrid"),
        {"1": 2.0},
        "md5",
        origin_of(pipeline, "data/raw/rig", PROCESSED),
        {"pressure_1_pa": [1e6, 1e6], "pressure_2_pa": [1e6, 1e6], "position_m": [0.1, 0.1]},
    )
    register(candidate, pipeline, 0.1, lambda folder: {})
    return pipeline


def broken(found: Lineage) -> dict[str, str]:
    return {link.name: link.found for link in found.links if not link.holds}


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def commit_all(root: Path) -> None:
    author = ("-c", "user.name=Tester", "-c", "user.email=tester@localhost")
    subprocess.run(["git", "-C", str(root), *author, "commit", "-qam", "Later"], check=True)


def test_the_whole_way_back_holds_and_is_printed(registered: Path) -> None:
    found = lineage(URI, registered)
    assert broken(found) == {}
    assert found.holds
    lines = found.text().splitlines()
    assert lines[0].startswith("friction-estimator version 1 (promoted: there is no incumbent")
    assert [line.split()[1] for line in lines[1:4]] == ["run", "git", "model"]
    assert any("dvc.lock raw/rig" in line and ".dir in the working tree" in line for line in lines)
    assert lines[-1] == f"all {len(found.links)} links hold"


def test_a_version_is_found_by_its_number_too(registered: Path) -> None:
    assert lineage("models:/friction-estimator/1", registered).holds


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


def test_what_has_moved_on_is_found_in_the_history(registered: Path) -> None:
    for file, old, new in (("params.yaml", "seed: 1", "seed: 7"), ("dvc.lock", ".dir", "0.dir")):
        change(registered / file, old, new)
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


def test_a_parameter_that_shapes_no_model_breaks_nothing(registered: Path) -> None:
    change(registered / "params.yaml", "tolerance_percent: 0.1", "tolerance_percent: 5.0")
    assert lineage(URI, registered).holds


def test_changed_data_is_a_broken_link(registered: Path) -> None:
    (registered / "data/raw/rig/log.csv").write_text("time,pressure\n0.0,99.0\n", encoding="utf-8")
    links = broken(lineage(URI, registered))
    assert links == {"data raw/rig": "neither on disk nor whole in DVC's cache; run `dvc pull`"}


def test_data_in_dvcs_cache_holds_and_is_read_to_the_last_byte(registered: Path) -> None:
    folder = registered / "data/raw/rig"
    files = [{"md5": dvc_hash(file), "relpath": file.name} for file in sorted(folder.iterdir())]
    place = registered / ".dvc/cache/files/md5"
    whole = dvc_hash(folder)
    for md5, content in [(whole, json.dumps(files).encode()), (files[0]["md5"], (folder / "log.csv").read_bytes())]:
        (place / md5[:2]).mkdir(parents=True, exist_ok=True)
        (place / md5[:2] / md5[2:]).write_bytes(content)
    shutil.rmtree(folder)
    assert lineage(URI, registered).holds
    (place / files[0]["md5"][:2] / files[0]["md5"][2:]).write_bytes(b"rotten")
    assert set(broken(lineage(URI, registered))) == {"data raw/rig"}


def test_a_model_that_was_tampered_with_is_a_broken_link(registered: Path) -> None:
    (network,) = registered.glob("mlartifacts/models/*/artifacts/artifacts/*/network.onnx")
    network.write_bytes(network.read_bytes() + b"\0")
    (link,) = broken(lineage(URI, registered)).items()
    assert link[0] == "model"
    assert "the registered files' hash is" in link[1]


def test_a_model_whose_files_are_gone_is_a_broken_link(registered: Path) -> None:
    shutil.rmtree(registered / "mlartifacts")
    links = broken(lineage(URI, registered))
    assert {"model", "tags", "parameters"} <= set(links)


def test_a_tag_that_was_changed_by_hand_is_a_broken_link(registered: Path) -> None:
    MlflowClient(tracking_uri(registered)).set_model_version_tag("friction-estimator", "1", "data_raw_md5", "other")
    assert broken(lineage(URI, registered)) == {"tags": "data_raw_md5 differ from the lineage.json inside the model"}


def test_a_deleted_run_is_a_broken_link(registered: Path) -> None:
    client = MlflowClient(tracking_uri(registered))
    client.delete_run(client.get_model_version("friction-estimator", "1").run_id or "")
    assert set(broken(lineage(URI, registered))) == {"run"}


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


@pytest.mark.slow
def test_hashes_are_those_of_dvc(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    for name, text in {"b.csv": "2", "a/z.csv": "1", "a-b.csv": "3", "a/é.csv": "4", "a.csv": "5"}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    for command in (["init", "--no-scm", "-q"], ["add", "-q", "data"]):
        subprocess.run([sys.executable, "-m", "dvc", *command], cwd=tmp_path, check=True, capture_output=True)
    written = yaml.safe_load((tmp_path / "data.dvc").read_text(encoding="utf-8"))
    assert dvc_hash(folder) == written["outs"][0]["md5"]
