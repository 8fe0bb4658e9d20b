"""A store filled from files: once, whole as far as the files go, and the champion's place left as it is."""

import shutil
from pathlib import Path

import pytest
from mlflow import MlflowClient

from candidates import NAME, champion, other_model, registered_in, runs_in, versions
from cylinder_friction.tracking.lineage import lineage
from cylinder_friction.tracking.registry import ALREADY, move_champion, track
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import tracking_uri
from pipeline_workspace import run

NOT_CHAMPION = "(not champion; `cylinder-friction promote 1 friction-estimator` makes it champion)"


@pytest.fixture
def registered_pipeline(pipeline: Path) -> Path:
    registered_in(pipeline)
    return pipeline


def test_tracking_fills_an_empty_store_once_and_promotes_nothing(
    registered_pipeline: Path, empty_store: Path, tmp_path: Path
) -> None:
    root = tmp_path / "clone"
    shutil.copytree(registered_pipeline, root, ignore=shutil.ignore_patterns("mlflow.db*", "mlartifacts"))
    shutil.copy(empty_store, root / "mlflow.db")
    first = track(root)
    assert first.logged == ["record", "search", "train", "compare", "register"]
    assert (first.present, first.problems) == ([], [])
    assert first.version == f"registered model: friction-estimator version 1 {NOT_CHAMPION}"
    assert move_champion(root, NAME, 1) == "friction-estimator: champion was none, is version 1"
    again = track(root)
    assert (again.logged, again.present) == ([], ["record", "search", "train", "compare", "register"])
    assert (
        again.summary() == "0 runs logged, 5 already there\nregistered model: friction-estimator version 1 (champion)"
    )
    assert len(versions(root)) == 1
    assert versions(root)[0].tags["decision"] == "promoted", "the decision is recorded as it was made"
    assert len(runs_in(root)) == 1 + 5 + 3, "trials below the search"


def test_tracking_leaves_what_a_person_did_to_the_registry(registered_pipeline: Path) -> None:
    root = registered_pipeline
    other_model(root)
    registered_in(root, {"1": 1.0, "2": 1.0})
    client = MlflowClient(tracking_uri(root))
    client.set_registered_model_alias(NAME, "champion", "1")
    assert (
        track(root).version
        == f"registered model: friction-estimator version 2 {NOT_CHAMPION.replace('promote 1', 'promote 2')}"
    )
    assert champion(root) == "1"
    client.delete_registered_model_alias(NAME, "champion")
    track(root)
    assert client.get_registered_model(NAME).aliases == {}
    client.delete_model_version(NAME, "2")
    gone = "has no version of models/hybrid: it was removed from the registry; to have it again, run"
    assert f"{gone} `cylinder-friction stage register`" in track(root).version
    assert [one.version for one in versions(root)] == [1]
    registered_in(root, {"1": 1.0, "2": 1.0})  # as that command does
    assert [str(one.version) for one in versions(root)] == ["1", "3"]
    assert champion(root) == "3"


def test_tracking_goes_on_past_what_is_missing_and_names_it(pipeline: Path) -> None:
    runs = pipeline / "reports/runs"
    (pipeline / "reports/report.html").unlink()
    (runs / "zz.json").write_text("{", encoding="utf-8")
    done = track(pipeline)
    assert done.logged == ["record", "search", "train"]
    assert done.version == "no model is registered yet"
    assert "not logged: compare.json: run 'compare': reports/report.html is not there; run `dvc pull`" in done.summary()
    assert "not logged: zz.json" in done.summary()


def test_tracking_of_nothing_says_what_to_do(root: Path) -> None:
    with pytest.raises(TrackingError, match="holds no run; run `dvc pull` or `dvc repro` first"):
        track(root)


def test_a_model_that_is_champion_is_found_whatever_tolerance_it_asked_with(registered_pipeline: Path) -> None:
    root = registered_pipeline
    again = registered_in(root, tolerance_percent=0.2)
    assert (again.promote, again.reason) == (True, ALREADY), "not the decision made at another tolerance as its own"
    assert track(root).version == "registered model: friction-estimator version 1 (champion)"
    other_model(root)
    assert not registered_in(root, {"1": 1.0, "2": 2.15}, tolerance_percent=0.1).promote
    looser = registered_in(root, {"1": 1.0, "2": 2.15}, tolerance_percent=0.2)
    assert looser.promote
    assert "within the tolerance of 0.2" in looser.reason
    assert (champion(root), len(versions(root))) == ("2", 2), "one version, asked again"
    assert track(root).version == "registered model: friction-estimator version 2 (champion)"


def test_artifacts_that_are_gone_are_named(registered_pipeline: Path) -> None:
    root = registered_pipeline
    shutil.rmtree(root / "mlartifacts/models")
    assert "version 1 (champion): its files are not at file:///" in track(root).version
    way = "or delete the version in the MLflow UI and run `cylinder-friction stage register`"
    with pytest.raises(TrackingError, match=way):
        registered_in(root)
    assert way in lineage(f"models:/{NAME}@champion", root).links["files"][1]
    MlflowClient(tracking_uri(root)).delete_model_version(NAME, "1")
    registered_in(root)
    assert champion(root) == "2"
    assert lineage(f"models:/{NAME}@champion", root).holds


def test_files_that_are_links_into_dvcs_cache_are_logged_and_registered(pipeline: Path) -> None:
    (pipeline / ".gitignore").unlink()  # DVC writes one
    linked = ("models/hybrid", "reports/figures", "reports/report.html")
    for words in (["init"], ["config", "cache.type", "symlink"], ["add", *linked]):
        run(pipeline, "dvc", words[0], "--quiet", *words[1:])
    assert (pipeline / "models/hybrid/network.onnx").is_symlink()
    registered_in(pipeline)
    assert track(pipeline).problems == []
    assert (champion(pipeline), len(runs_in(pipeline))) == ("1", 1 + 5 + 3)
    found = lineage(f"models:/{NAME}@champion", pipeline)
    assert found.links["files"][0], found.text()
    logged = [path for path in (pipeline / "mlartifacts").rglob("*") if path.is_symlink()]
    assert logged == []
