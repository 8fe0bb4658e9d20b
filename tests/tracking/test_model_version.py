"""A candidate's version: all that a served model needs, and only of the model that was measured."""

import json
from pathlib import Path

import mlflow
import pytest
from mlflow import MlflowClient

from candidates import candidate_in, measured, other_model, registered_in, versions
from cylinder_friction.tracking.registry import register
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import tracking_uri


def test_the_logged_model_carries_all_it_needs_and_no_pickle(pipeline: Path) -> None:
    register(candidate_in(pipeline), pipeline, measured)
    (description,) = pipeline.glob("mlartifacts/models/*/artifacts/MLmodel")
    files = [path for path in description.parent.rglob("*") if path.is_file()]
    needed = {"scoring.py", "scoring_model.py", "golden.json", "network.onnx", "forest.onnx", "lineage.json"}
    assert {path.name for path in files} >= needed
    assert {path.suffix for path in files} <= {"", ".py", ".json", ".onnx", ".yaml", ".txt"}
    assert not [path for path in files if path.read_bytes().startswith(b"\x80")], "that is how a pickle begins"
    loaded = mlflow.pyfunc.load_model(str(description.parent))
    named = {"pressure_1_pa", "pressure_2_pa", "position_m", "recording", "time_s"}
    assert loaded.metadata.metadata["inputs"].keys() == named
    outputs = ["friction_n", "lower_n", "upper_n", "flags", "flag_names", "in_training_range"]
    assert list(loaded.predict(loaded.input_example).columns) == outputs
    assert loaded.metadata.signature.outputs.required_input_names() == outputs


def test_the_logged_model_appears_as_registered_with_its_errors_and_what_they_were_measured_on(pipeline: Path) -> None:
    for _ in range(2):  # once more changes nothing
        registered_in(pipeline)
    client = MlflowClient(tracking_uri(pipeline))
    (version,) = versions(pipeline)
    model = client.get_logged_model(str(version.source).removeprefix("models:/"))
    assert json.loads(model.tags["mlflow.modelVersions"]) == [{"name": version.name, "version": str(version.version)}]
    assert model.params == {"seed": "2"}, "of the training"
    run = client.get_run(version.run_id or "")
    assert run.data.tags["stage"] == "pipeline"
    test = next(each.dataset for each in run.inputs.dataset_inputs if each.dataset.name == "test")
    metrics = {metric.key: metric for metric in model.metrics or []}
    assert metrics["label_error_percent/condition_1"].value == 2.0
    for metric in metrics.values():
        assert (metric.dataset_name, metric.dataset_digest) == (test.name, test.digest)
    assert [each.model_id for each in run.outputs.model_outputs] == [model.model_id]


def test_a_model_that_is_not_the_measured_one_is_refused(pipeline: Path) -> None:
    candidate = candidate_in(pipeline)
    other_model(pipeline)
    with pytest.raises(TrackingError, match=r"models/hybrid: its hash is .*… was measured; run `dvc checkout`"):
        register(candidate, pipeline, measured)
