"""Registered versions and their files: look up a version, copy its model folder, find the estimator inside."""

import re
from pathlib import Path

from mlflow import artifacts
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model

from cylinder_friction.tracking.repository import LineageError, TrackingError
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.wording import in_brief


def version_of(store: Store, uri: str) -> ModelVersion:
    """Look up the registered version that ``models:/<name>@<alias>`` or ``models:/<name>/<version>`` names.

    Raises:
        LineageError: The URI has another form, or the registry has no such version.
    """
    parts = re.fullmatch(r"models:/(?P<name>[^/@]+)(@(?P<alias>[^/@]+)|/(?P<version>\d+))", uri)
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
    """Copy the model folder of a registered version into ``folder``; return its path, from which MLflow loads it.

    Raises:
        TrackingError: The version's files cannot be read.
    """
    try:
        location = store.client.get_model_version_download_uri(version.name, version.version)
        return Path(artifacts.download_artifacts(location, dst_path=str(folder), tracking_uri=store.uri))
    except Exception as error:  # each kind of storage raises its own errors
        where = f"{version.name} version {version.version}: its files at {version.source}"
        raise TrackingError(f"{where} cannot be read ({in_brief(error)})") from error


def saved_estimator(model_folder: Path) -> Path:
    """Find the folder of the estimator inside a model folder."""
    flavor = Model.load(str(model_folder)).flavors["python_function"]
    return model_folder / str(flavor["artifacts"]["estimator"]["path"])


def estimator_folder(uri: str, root: Path, scratch: Path) -> tuple[Path, str]:
    """Copy the estimator inside a registered model into ``scratch``; return its folder and the version's URI.

    Raises:
        TrackingError: The registry cannot be reached or has no such model.
    """
    with open_store(root, create=False) as store:
        version = version_of(store, uri)
        folder = saved_estimator(download_model(store, version, scratch))
    return folder, f"models:/{version.name}/{version.version}"
