"""Where runs and models are kept: SQLite in the repository, or any server that ``MLFLOW_TRACKING_URI`` names."""

import fcntl
import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import mlflow
from mlflow import MlflowClient
from mlflow.exceptions import MlflowException

from cylinder_friction.tracking.repository import TrackingError, repository_root

EXPERIMENT = "cylinder-friction"
LOCAL_FOLDER = ".cylinder-friction"  # What belongs to this machine and is neither versioned nor shared
_NOTE = "One run per stage of the pipeline; the trials of the search lie below its run."
_CONNECT_TIMEOUT_S = 3.0


@dataclass(frozen=True)
class Store:
    """An open tracking store."""

    uri: str  # Tracking and registry URI
    root: Path  # Absolute root of the repository
    client: MlflowClient  # Talks to that URI
    experiment_id: str  # The project's main experiment

    def experiment(self, part: str) -> str:
        """Return the id of one of the project's experiments, made if it is not there yet; ``""`` is the main one."""
        return _experiment(self.client, self.uri, self.root, experiment_name(part)) if part else self.experiment_id


def experiment_name(part: str = "") -> str:
    """Return the name in MLflow of one of the project's experiments; ``""`` is the main one."""
    return f"{EXPERIMENT}-{part}" if part else EXPERIMENT


def tracking_uri(root: Path) -> str:
    """Return ``MLFLOW_TRACKING_URI`` where it is set, else SQLite at the repository's root by absolute path."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{repository_root(root) / 'mlflow.db'}"


def artifact_folder(root: Path) -> Path:
    """Return where the default store keeps its artifacts."""
    return repository_root(root) / "mlartifacts"


@contextmanager
def open_store(root: Path) -> Iterator[Store]:
    """Yield the store, made if it is not there yet; other processes of this repository wait until the block ends.

    The lock makes "look whether it is there, else log it" one step, and a killed process gives it back.

    Raises:
        TrackingError: The server does not respond.
    """
    uri = tracking_uri(root)
    _refuse_silent_server(uri)
    with _locked(repository_root(root) / LOCAL_FOLDER / "tracking.lock"), _default_for_mlflow(uri):
        _quiet()
        client = MlflowClient(tracking_uri=uri, registry_uri=uri)
        experiment_id = _experiment(client, uri, root, EXPERIMENT)
        _quiet()  # creating the schema sets its own levels
        yield Store(uri, repository_root(root), client, experiment_id)


def _experiment(client: MlflowClient, uri: str, root: Path, name: str) -> str:
    found = client.get_experiment_by_name(name)
    if found is not None:
        if found.lifecycle_stage == "deleted":
            client.restore_experiment(found.experiment_id)
        return str(found.experiment_id)
    location = artifact_folder(root).as_uri() if uri.startswith("sqlite:") else None
    tags = {"mlflow.experimentKind": "custom_model_development"}  # the UI opens on the runs, not on traces of agents
    if name == EXPERIMENT:
        tags["mlflow.note.content"] = _NOTE
    try:
        return str(client.create_experiment(name, artifact_location=location, tags=tags))
    except MlflowException:
        # A shared server: another machine may have made it between the look and the creation.
        found = client.get_experiment_by_name(name)
        if found is None:
            raise
        return str(found.experiment_id)


def _refuse_silent_server(uri: str) -> None:
    """MLflow retries for minutes; one short connection shows whether it listens."""
    parts = urlsplit(uri)
    if parts.scheme not in ("http", "https"):
        return
    port = parts.port or (443 if parts.scheme == "https" else 80)
    try:
        socket.create_connection((parts.hostname or "", port), timeout=_CONNECT_TIMEOUT_S).close()
    except OSError as error:
        raise TrackingError(
            f"MLFLOW_TRACKING_URI is {uri}, but nothing responds there ({error}); start the tracking server, correct "
            "the variable, or unset it to use the repository's own store"
        ) from error


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@contextmanager
def _default_for_mlflow(uri: str) -> Iterator[None]:
    """MLflow's registry asks its own global for the store of models; it gets it, and the environment back after."""
    before = os.environ.get("MLFLOW_TRACKING_URI")
    mlflow.set_tracking_uri(uri)
    try:
        yield
    finally:
        mlflow.set_tracking_uri(None)  # type: ignore[arg-type]  # None is MLflow's "ask the environment"
        if before is not None:
            os.environ["MLFLOW_TRACKING_URI"] = before


def _quiet() -> None:
    for name in ("mlflow", "alembic", "sqlalchemy"):
        logging.getLogger(name).setLevel(logging.WARNING)
