"""Datasets as MLflow shows them: a schema, one digest, and a source that MLflow alone resolves."""

from __future__ import annotations

import json
from pathlib import Path

import mlflow.data
import pytest

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.stages._stage import datasets
from cylinder_friction.tracking.datasets import dataset_input, digest_of


def test_a_folder_of_recordings_is_a_dataset_that_mlflow_resolves(
    written_pipeline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written_pipeline)
    folder = Path("data/processed/test")
    (used,) = datasets({"test": folder}).values()
    found = dataset_input("test", used)
    assert found.dataset.digest == hash_of(folder)[:36] == digest_of(used)
    schema = json.loads(found.dataset.schema or "")["mlflow_colspec"]
    recordings = read_recordings(folder)
    assert [column["name"] for column in schema] == list(recordings[0].table.columns)
    types = {column["name"]: column["type"] for column in schema}
    assert (types["friction_n"], types["usable"]) == ("double", "boolean")
    assert json.loads(found.dataset.profile or "")["num_rows"] == sum(map(len, recordings))
    assert mlflow.data.get_source(found).load() == str(folder.resolve())


@pytest.mark.parametrize(("written", "context"), [(False, "train"), (True, "written")])
def test_the_context_states_whether_a_run_read_or_wrote_it(
    written: bool, context: str, written_pipeline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written_pipeline)
    (used,) = datasets({"train": Path("data/processed/train")}, written=written).values()
    assert [(tag.key, tag.value) for tag in dataset_input("train", used).tags] == [("mlflow.data.context", context)]
