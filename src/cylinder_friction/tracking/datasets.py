"""Folders of recordings as MLflow datasets: schema, one digest, and a source that resolves wherever MLflow is."""

import json

from mlflow.entities import Dataset as MlflowDataset
from mlflow.entities import DatasetInput, InputTag
from mlflow.types import ColSpec, DataType, Schema, TensorSpec
from mlflow.utils.mlflow_tags import MLFLOW_DATASET_CONTEXT

from cylinder_friction.run_record import Dataset

_LONGEST_DIGEST = 36
_TYPES = {
    "double": DataType.double,
    "float": DataType.float,
    "int64": DataType.long,
    "int32": DataType.integer,
    "bool": DataType.boolean,
}


def dataset_input(role: str, dataset: Dataset) -> DatasetInput:
    """Return a dataset as the input of a run; in MLflow what a run wrote is an input too, so its context states it.

    Its source is a path within the repository, which MLflow resolves by itself: where the repository lies on another
    machine, nobody knows.
    """
    columns: list[ColSpec | TensorSpec] = [
        ColSpec(_TYPES.get(kind, DataType.string), name) for name, kind in dataset.columns.items()
    ]
    return DatasetInput(
        MlflowDataset(
            name=role,
            digest=digest_of(dataset),
            source_type="local",
            source=json.dumps({"uri": dataset.path}),
            schema=json.dumps({"mlflow_colspec": Schema(columns).to_dict()}) if columns else None,
            profile=json.dumps({"num_rows": dataset.rows, "num_elements": dataset.rows * len(dataset.columns)}),
        ),
        [InputTag(MLFLOW_DATASET_CONTEXT, "written" if dataset.written else role)],
    )


def digest_of(dataset: Dataset) -> str:
    """Return the digest by which MLflow knows a dataset: as much of its SHA-256 as MLflow takes."""
    return dataset.sha256[:_LONGEST_DIGEST]
