"""Where runs and models are kept: SQLite in the repository, or any server that ``MLFLOW_TRACKING_URI`` names."""

import logging
import os
import socket
import sqlite3
import uuid
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import mlflow
from mlflow import MlflowClient
from mlflow.entities import LoggedModel, Metric
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.store.db.db_types import DATABASE_ENGINES
from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore
from mlflow.utils import chunk_list

from cylinder_friction.recordings.locks import locked
from cylinder_friction.tracking.repository import TrackingError, repository_root
from cylinder_friction.wording import in_brief

EXPERIMENT = "cylinder-friction"
LOCAL_FOLDER = ".cylinder-friction"  # What belongs to this machine and is neither versioned nor shared
_NOTE = (
    "Each run `pipeline ...` is one execution. **Which is better, and in which condition?** Choose *Model training* in "
    "the sidebar, then *Runs*, then the charts: `error_percent` shows the mean absolute errors of their models on "
    "held-out recordings [% of mean friction, against true friction where it is known], smaller is better; "
    "`held_by_bounds_percent` how often the stated bounds hold. Expand a run for its stages: `compare` has the report, "
    "and all estimators in `errors_by_condition.json`."
)
_CONNECT_TIMEOUT_S = 3.0
_METRICS_A_REQUEST = 1000
_LOCK_TIMEOUT_S = 30.0
_SERVERS = ("http", "https")
_LOCATIONS = (
    ("experiments", "artifact_location"),
    ("runs", "artifact_uri"),
    ("logged_models", "artifact_location"),
    ("model_versions", "storage_location"),
)
"""Where MLflow's database holds absolute addresses of artifacts."""


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

    def logged_model(self, version: ModelVersion) -> LoggedModel:
        """Return the logged model that was registered as this version."""
        return self.client.get_logged_model(str(version.source).removeprefix("models:/"))

    def log_metrics(self, run_id: str, metrics: Sequence[Metric]) -> None:
        """Log any number of metrics; a server takes only so many at a time."""
        for some in chunk_list(metrics, _METRICS_A_REQUEST):
            self.client.log_batch(run_id, metrics=some)


def experiment_name(part: str = "") -> str:
    """Return the name in MLflow of one of the project's experiments; ``""`` is the main one."""
    return f"{EXPERIMENT}-{part}" if part else EXPERIMENT


def tracking_uri(root: Path) -> str:
    """Return ``MLFLOW_TRACKING_URI`` where it is set, else SQLite at the repository's root by absolute path."""
    return os.environ.get("MLFLOW_TRACKING_URI") or _own_uri(repository_root(root))


def _own_uri(root: Path) -> str:
    return f"sqlite:///{root / 'mlflow.db'}"


def artifact_folder(root: Path) -> Path:
    """Return where the default store keeps its artifacts."""
    return repository_root(root) / "mlartifacts"


@contextmanager
def open_store(root: Path, *, create: bool = True) -> Iterator[Store]:
    """Yield the store; other processes of this repository wait until the block ends.

    The lock makes "look whether it is there, else log it" one step, and a killed process gives it back. Artifacts of
    the repository's own store are those of the repository as it lies now, also after it was moved or copied.

    Raises:
        TrackingError: There is no store, the server does not respond, MLflow cannot open it, or refuses what the block
            asks for.
    """
    uri, root = tracking_uri(root), repository_root(root)
    _refuse_what_is_no_store(uri, create=create)
    with locked(root / LOCAL_FOLDER / "tracking.lock"), _default_for_mlflow(uri):
        _quiet()
        if uri == _own_uri(root):
            _make_whole(root)
            _follow_a_move(root)
        try:
            client = MlflowClient(tracking_uri=uri, registry_uri=uri)
            experiment_id = _experiment(client, uri, root, EXPERIMENT)
        except Exception as error:  # of the server, of its database's driver, of a file
            raise TrackingError(
                f"{uri} is no MLflow store that can be opened ({in_brief(error)}); correct MLFLOW_TRACKING_URI, or the "
                "login in ~/.mlflow/credentials, or unset it to use the repository's own store"
            ) from error
        _quiet()  # creating the schema sets its own levels
        try:
            yield Store(uri, root, client, experiment_id)
        except MlflowException as error:
            raise TrackingError(f"{uri}: MLflow refused a request ({in_brief(error)})") from error


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


def _make_whole(root: Path) -> None:
    """Make the repository's own store where it is not there: aside, so that a kill leaves a whole one or none."""
    path = root / "mlflow.db"
    for left in root.glob(".mlflow.*.draft*"):
        left.unlink()
    if path.exists():
        return
    draft = root / f".mlflow.{uuid.uuid4().hex}.draft"
    try:
        made = SqlAlchemyStore(f"sqlite:///{draft}", artifact_folder(root).as_uri())
        made.engine.dispose()
        draft.replace(path)
    except Exception as error:
        draft.unlink(missing_ok=True)
        raise TrackingError(f"{path}: cannot be made ({in_brief(error)})") from error


def _follow_a_move(root: Path) -> None:
    """Let the repository's own store name the artifacts beside it: MLflow writes down where they lay at first."""
    path, here = root / "mlflow.db", artifact_folder(root).as_uri()
    if not path.is_file():
        return
    with closing(sqlite3.connect(path, timeout=_LOCK_TIMEOUT_S)) as database, database:
        try:
            found = database.execute(
                "SELECT artifact_location FROM experiments WHERE name = ?", (EXPERIMENT,)
            ).fetchone()
        except sqlite3.DatabaseError:
            return  # it has no tables yet, or is no database, which MLflow refuses
        if found is None or found[0] == here:
            return
        for table, column in _LOCATIONS:
            database.execute(
                f"UPDATE {table} SET {column} = ? || substr({column}, ?) WHERE substr({column}, 1, ?) = ?",  # noqa: S608
                (here, len(found[0]) + 1, len(found[0]) + 1, f"{found[0]}/"),
            )
        database.execute("UPDATE experiments SET artifact_location = ? WHERE artifact_location = ?", (here, found[0]))


def _refuse_what_is_no_store(uri: str, *, create: bool) -> None:
    """MLflow makes a database at whatever path it gets, and retries for minutes where no server listens."""
    parts = urlsplit(uri)
    if parts.scheme == "sqlite" and not create and not Path(uri.removeprefix("sqlite:///")).is_file():
        raise TrackingError(
            f"{uri}: there is no such store; run `dvc repro`, or `cylinder-friction track` where the results came from "
            "DVC, in the project's folder"
        )
    if parts.scheme.partition("+")[0] not in (*_SERVERS, *DATABASE_ENGINES):
        raise TrackingError(
            f"MLFLOW_TRACKING_URI is {uri}, but expected http://, https:// or a database ({', '.join(DATABASE_ENGINES)}"
            "); correct it, or unset it to use the repository's own store"
        )
    if parts.scheme not in _SERVERS:
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
