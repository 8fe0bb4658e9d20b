"""Stage ``register``: same inputs, same file; a kill changes nothing; no registry, no decision."""

import json
import shutil
from pathlib import Path

import mlflow
import pytest
from mlflow import MlflowClient

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.evaluation.comparison import compare
from cylinder_friction.execution.ports import free_port
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.stages import register
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import tracking_uri
from shipped_params import shipped

NAME = "friction-estimator"


@pytest.fixture
def repository(tmp_path: Path, written_pipeline: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    copy = tmp_path / "repository"
    shutil.copytree(written_pipeline, copy)
    monkeypatch.chdir(copy)
    return copy


def registered(root: Path) -> str:
    return (root / "models/registered.json").read_text(encoding="utf-8")


def test_the_candidate_is_registered_and_the_file_says_on_what_grounds(repository: Path) -> None:
    record = register.run(shipped())
    content = json.loads(registered(repository))
    assert content["promote"] is True
    assert content["errors_percent"] == {"1": 2.1, "2": 2.2, "3": 2.3, "4": 2.4}
    assert list(content["data"]) == sorted(content["data"])
    assert str(repository) not in registered(repository), "no absolute path in a file that DVC tracks"
    assert record.metrics["label_error_percent/mean"] == pytest.approx(2.25)
    card = content["card"]
    assert "- Trained on: 2 recordings" in card
    (version,) = MlflowClient(tracking_uri(repository)).search_model_versions(f"name = '{NAME}'")
    assert version.description.startswith("**Promoted: there is no incumbent")
    assert card in version.description
    assert content["data"]["data/raw/rig"] in version.description
    assert f"`cylinder-friction lineage models:/{NAME}/1` checks it." in version.description
    client, first = MlflowClient(tracking_uri(repository)), registered(repository)
    assert client.get_model_version_by_alias(NAME, "champion").tags["hash_model"] == content["model_md5"]
    assert register.run(shipped()) == record
    assert registered(repository) == first, "running it again changes no byte"
    assert len(client.search_model_versions(f"name = '{NAME}'")) == 1


def test_an_incumbent_from_other_recordings_is_measured_on_the_present_ones(
    repository: Path, small_hybrid: HybridEstimator
) -> None:
    register.run(shipped())
    lock = repository / "dvc.lock"
    test_data = json.loads(registered(repository))["data"]["data/processed/test"]
    lock.write_text(lock.read_text(encoding="utf-8").replace(test_data, "0" * 32 + ".dir"), encoding="utf-8")
    path = repository / "models/hybrid/estimator.json"
    path.write_text(path.read_text(encoding="utf-8").replace('"friction_n"', '"friction_n" '), encoding="utf-8")
    register.run(shipped())
    measured = json.loads(registered(repository))["incumbent"]
    hybrid, recordings = load_estimator(repository / "models/hybrid"), read_stored(repository / "data/processed/test")
    compared = compare({"hybrid": hybrid}, recordings)
    assert measured == {condition: compared.percent("hybrid", condition) for condition in ("1", "2", "3", "4")}


def test_the_gate_goes_by_true_friction_where_it_is_known(repository: Path) -> None:
    path = repository / "reports/metrics.json"
    metrics = json.loads(path.read_text(encoding="utf-8"))
    for condition, numbers in metrics["hybrid"].items():
        numbers["truth_percent"] = 1.0 + 0.1 * int(condition)
    path.write_text(json.dumps(metrics), encoding="utf-8")
    record = register.run(shipped())
    content = json.loads(registered(repository))
    assert content["reference"] == "truth"
    assert content["errors_percent"] == {"1": 1.1, "2": 1.2, "3": 1.3, "4": 1.4}
    assert record.metrics["truth_error_percent/condition_1"] == 1.1
    del metrics["hybrid"]["3"]["truth_percent"]
    path.write_text(json.dumps(metrics), encoding="utf-8")
    register.run(shipped())
    assert json.loads(registered(repository))["reference"] == "label"


def test_without_a_registry_nothing_is_decided(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://127.0.0.1:{free_port()}")
    with pytest.raises(TrackingError, match=r"no MLflow store .*Connection refused.*; start the server"):
        register.run(shipped())
    assert not (repository / "models/registered.json").exists()


def test_what_was_not_compared_or_has_no_way_back_is_not_registered(repository: Path) -> None:
    with pytest.raises(
        TrackingError, match=r"metrics.json: has no estimator 'paper_hybrid', but \['hybrid'\]; run the"
    ):
        register.run(shipped(register={"candidate": "paper_hybrid"}))
    (repository / "dvc.lock").unlink()
    with pytest.raises(RecordingError, match="run the pipeline with `dvc repro`"):
        register.run(shipped())


@pytest.mark.extended
def test_any_estimator_of_the_comparison_with_a_real_time_step_is_registered(
    repository: Path, labelled_recordings: list[Recording], cylinder: Cylinder
) -> None:
    path = repository / "reports/metrics.json"
    numbers = json.loads(path.read_text(encoding="utf-8"))["hybrid"]
    path.write_text(json.dumps(dict.fromkeys(("hybrid", "ridge", "lugre"), numbers)), encoding="utf-8")
    ridge = RidgeEstimator().fit(labelled_recordings)
    ridge.calibrate(labelled_recordings, labelled_recordings, cylinder)
    ridge.save(repository / "models/baselines/ridge")
    register.run(shipped(register={"candidate": "ridge"}))
    (version,) = MlflowClient(tracking_uri(repository)).search_model_versions(f"name = '{NAME}'")
    assert version.description.count("Ridge") + version.description.count("ridge")
    assert json.loads(registered(repository))["folder"] == "models/baselines/ridge"
    served = mlflow.pyfunc.load_model(f"models:/{NAME}@champion")
    assert len(served.predict(served.input_example)) == len(served.input_example)
    AnalyticalEstimator(cylinder, LuGre()).fit(labelled_recordings).save(repository / "models/lugre/lugre")
    with pytest.raises(
        TrackingError, match=r"register.candidate is 'lugre', which has no real-time step to serve; name"
    ):
        register.run(shipped(register={"candidate": "lugre"}))
