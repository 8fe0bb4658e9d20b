"""The estimator as an MLflow model: a folder with code, ONNX and JSON, signature, example and origin."""

import re
import shutil
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import pandas as pd
from mlflow import artifacts
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model, ModelSignature
from mlflow.types import ColSpec, DataType, Schema

from cylinder_friction.deployment.brought_code import MODEL_CODE, copy_package, described, requirements_of
from cylinder_friction.deployment.golden_recording import recorded
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE
from cylinder_friction.deployment.scoring import RECORDING_COLUMN, TIME_COLUMN
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.columns import LOAD_FORCE
from cylinder_friction.tracking.repository import LineageError, TrackingError
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.wording import in_brief

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


def input_schema(model: StepModel) -> Schema:
    """List the columns that the served model takes. MLflow refuses a table without the required ones.

    The load is optional in every model: MLflow drops columns that a signature does not name, and a model that knows no
    load must see one to refuse it.
    """
    optional = [ColSpec(DataType.string, RECORDING_COLUMN, required=False)]
    optional += [ColSpec(DataType.double, name, required=False) for name in (TIME_COLUMN, LOAD_FORCE)]
    required = [ColSpec(DataType.double, name) for name in model.inputs]
    return Schema([*required, *(each for each in optional if each.name not in model.inputs)])


def save_model_folder(
    path: Path, estimator: Path, lineage: dict[str, Any], example: pd.DataFrame, mlflow_model: Model
) -> None:
    """Write an MLflow model folder that holds everything the served model needs.

    The files of ``estimator``, a folder, go in as they are, ``lineage`` as ``lineage.json``. ``mlflow_model`` carries
    the ids that MLflow gave the model.
    """
    lineage_path, golden = path.with_name("lineage.json"), path.with_name(GOLDEN_FILE)
    write_json(lineage_path, lineage)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # MLflow's pyfunc warns of its own type hints when imported
        pyfunc = import_module("mlflow.pyfunc")
    loaded = load_estimator(estimator)
    model = loaded.step_model()
    write_json(golden, recorded(model))
    pyfunc.save_model(
        path=str(path),
        python_model=str(MODEL_CODE),
        code_paths=[str(copy_package(path.with_name("code")))],
        artifacts={"estimator": str(estimator), "golden": str(golden), "lineage": str(lineage_path)},
        signature=ModelSignature(input_schema(model), OUTPUTS),
        metadata=described(model),
        input_example=example,
        pip_requirements=requirements_of(loaded.kind),
        mlflow_model=mlflow_model,
    )
    for cache in path.rglob("__pycache__"):
        shutil.rmtree(cache)


def version_of(store: Store, uri: str) -> ModelVersion:
    """Look up the registered version that ``models:/<name>@<alias>`` or ``models:/<name>/<version>`` names.

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
            "`cylinder-friction track` if the results came from DVC, and `cylinder-friction promote VERSION`"
        ) from error


def download_model(store: Store, version: ModelVersion, folder: Path) -> Path:
    """Copy the model folder of a registered version below ``folder``, from where MLflow loads it.

    Raises:
        TrackingError: Its files cannot be read.
    """
    try:
        location = store.client.get_model_version_download_uri(version.name, version.version)
        return Path(artifacts.download_artifacts(location, dst_path=str(folder), tracking_uri=store.uri))
    except Exception as error:  # each kind of place has its own
        where = f"{version.name} version {version.version}: its files at {version.source}"
        raise TrackingError(f"{where} cannot be read ({in_brief(error)})") from error


def saved_estimator(model_folder: Path) -> Path:
    """Return the folder of the estimator inside a model folder."""
    flavor = Model.load(str(model_folder)).flavors["python_function"]
    return model_folder / str(flavor["artifacts"]["estimator"]["path"])


def estimator_folder(uri: str, root: Path, scratch: Path) -> tuple[Path, str]:
    """Copy the estimator inside a registered model below ``scratch``; return its folder and the version's URI.

    Raises:
        TrackingError: The registry cannot be reached or has no such model.
    """
    with open_store(root, create=False) as store:
        version = version_of(store, uri)
        folder = saved_estimator(download_model(store, version, scratch))
    return folder, f"models:/{version.name}/{version.version}"
