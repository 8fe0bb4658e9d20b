"""The estimator as an MLflow model: a folder with code, ONNX and JSON, signature, example and origin."""

import json
import re
import warnings
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import pandas as pd
from mlflow import artifacts
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model, ModelSignature
from mlflow.types import ColSpec, DataType, Schema

from cylinder_friction.deployment.descriptions import described_inputs
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, difference_n, recorded
from cylinder_friction.deployment.onnx_graphs.export import SEQUENCE_FILE
from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.scoring import ServedGraph
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.files import write_bytes, write_json
from cylinder_friction.tracking.repository import LineageError, TrackingError
from cylinder_friction.tracking.store import Store, open_store

MODEL_CODE = Path(__file__).parents[1] / "deployment/scoring_model.py"
SCORING_CODE = Path(__file__).parents[1] / "deployment/scoring.py"
ESTIMATOR_ARTIFACT = "estimator"
GOLDEN_ARTIFACT = "golden"
LINEAGE_ARTIFACT = "lineage"
# The names that the served model's code asks for
GRAPH_ARTIFACT = "graph"
SCORING_ARTIFACT = "scoring"
LINEAGE_FILE = "lineage.json"
REQUIREMENTS = ("mlflow", "numpy", "onnxruntime", "pandas")
"""All that the served model needs; the estimator's own files are beside its graph for this project's commands."""

_URI = re.compile(r"models:/(?P<name>[^/@]+)(@(?P<alias>[^/@]+)|/(?P<version>\d+))$")

OUTPUTS = Schema(
    [
        *(ColSpec(DataType.double, name) for name in ("friction_n", "lower_n", "upper_n")),
        ColSpec(DataType.long, "flags"),
        ColSpec(DataType.string, "flag_names"),
        ColSpec(DataType.boolean, "in_training_range"),
        *(ColSpec(DataType.double, name, required=False) for name in ("offset_n", "offset_uncertainty_n")),
    ]
)


def inputs_of(model: StepModel) -> dict[str, str]:
    """Return the columns that the served model takes and what they mean, for the metadata of the logged model.

    Its signature has outputs alone: MLflow would leave out columns that a signature does not name, and make numbers of
    booleans and text, before the model could refuse them.
    """
    optional = {
        "recording": "optional: the name of each row's recording, whose rows follow each other",
        "time_s": "optional: each row's time, to be checked [s]",
    }
    return {each.column: each.meaning for each in described_inputs(model.inputs)} | optional


def save_model_folder(
    path: Path, estimator: Path, lineage: dict[str, Any], example: pd.DataFrame, mlflow_model: Model
) -> None:
    """Write an MLflow model folder that holds everything the served model needs.

    The files of ``estimator``, a folder, go in as they are, ``lineage`` as ``lineage.json``; ``mlflow_model`` carries
    the ids that MLflow gave the model.
    """
    lineage_path = path.with_name(LINEAGE_FILE)
    lineage_path.write_text(json.dumps(lineage, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # MLflow's pyfunc warns of its own type hints when imported
        pyfunc = import_module("mlflow.pyfunc")
    graph, golden = path.with_name(SEQUENCE_FILE), path.with_name(GOLDEN_FILE)
    model = load_estimator(estimator).step_model()
    write_bytes(graph, sequence_graph(model).SerializeToString(deterministic=True))
    served = ServedGraph(graph)
    write_json(golden, trajectory := recorded(served, model))
    difference_n(served.run, trajectory)
    pyfunc.save_model(
        path=str(path),
        python_model=str(MODEL_CODE),
        artifacts={
            GRAPH_ARTIFACT: str(graph),
            SCORING_ARTIFACT: str(SCORING_CODE),
            GOLDEN_ARTIFACT: str(golden),
            ESTIMATOR_ARTIFACT: str(estimator),
            LINEAGE_ARTIFACT: str(lineage_path),
        },
        signature=ModelSignature(outputs=OUTPUTS),
        metadata={"inputs": inputs_of(model)},
        input_example=example,
        pip_requirements=[f"{name}=={metadata.version(name)}" for name in REQUIREMENTS],
        mlflow_model=mlflow_model,
    )


def version_of(store: Store, uri: str) -> ModelVersion:
    """Return the registered version that ``models:/<name>@<alias>`` or ``models:/<name>/<version>`` names.

    Raises:
        LineageError: The URI has another form, or the registry has no such version.
    """
    parts = _URI.match(uri)
    if parts is None:
        raise LineageError(
            f"{uri!r} names no registered model; expected models:/<name>@<alias> or models:/<name>/<version>"
        )
    try:
        if parts["alias"]:
            return store.client.get_model_version_by_alias(parts["name"], parts["alias"])
        return store.client.get_model_version(parts["name"], parts["version"])
    except MlflowException as error:
        raise LineageError(
            f"{uri}: the registry at {store.uri} has no such version ({error.message}); run `dvc repro`, or "
            "`cylinder-friction track` where the results came from DVC, and `cylinder-friction rollback --to VERSION`"
        ) from error


def download_model(store: Store, version: ModelVersion, folder: Path) -> Path:
    """Return the model folder of a registered version, copied below ``folder``, from where MLflow loads it.

    Raises:
        TrackingError: Its files cannot be read.
    """
    try:
        location = store.client.get_model_version_download_uri(version.name, version.version)
        return Path(artifacts.download_artifacts(location, dst_path=str(folder), tracking_uri=store.uri))
    except Exception as error:  # each kind of place has its own, and a version may name any place
        raise TrackingError(
            f"{version.name} version {version.version}: its files at {version.source} cannot be read ({error})"
        ) from error


def estimator_folder(uri: str, root: Path, scratch: Path) -> tuple[Path, str]:
    """Return the folder of the estimator inside a registered model, copied below ``scratch``, and its version's URI.

    Raises:
        TrackingError: The registry cannot be reached or has no such model.
    """
    with open_store(root, create=False) as store:
        version = version_of(store, uri)
        folder = artifact_path(download_model(store, version, scratch), ESTIMATOR_ARTIFACT)
    return folder, f"models:/{version.name}/{version.version}"


def artifact_path(model_folder: Path, artifact: str) -> Path:
    """Return where an artifact lies in a model folder."""
    configured = Model.load(str(model_folder)).flavors["python_function"]["artifacts"][artifact]["path"]
    return model_folder / configured
