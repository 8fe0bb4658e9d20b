"""Where runs and models are kept: SQLite in the repository, or any server that ``MLFLOW_TRACKING_URI`` names."""

import hashlib
import logging
import os
import sqlite3
import sys
import uuid
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
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
from mlflow.utils.credentials import get_default_host_creds
from mlflow.utils.rest_utils import http_request

from cylinder_friction.files.locks import locked
from cylinder_friction.tracking.repository import TrackingError, repository_root
from cylinder_friction.wording import in_brief

EXPERIMENT = "cylinder-friction"
LOCAL_FOLDER = ".cylinder-friction"  # What belongs to this machine and is neither versioned nor shared
ANSWER_TIMEOUT_S = 5.0
"""Time limit for a server's first answer [s]."""
_NOTE = (
    "Each run named after its recipe is one execution of the pipeline: `recipe`, seeds, what differs from the default "
    "recipe, sessions and rows, and the mean absolute errors of its model on held-out recordings [% of mean friction] "
    "as `truth_error_percent/...` or `label_error_percent/...`, after what they are measured against; smaller is "
    "better. Sort by `.../mean`. Below each run are its stages, below the search its trials."
)
_VARIABLE, _SERVERS = "MLFLOW_TRACKING_URI", ("http", "https")
_CORRECT = f"correct {_VARIABLE}, or the login in ~/.mlflow/credentials, or unset it to use the repository's own store"
_METRICS_A_REQUEST, _LOCK_TIMEOUT_S = 1000, 30.0
_LOCATIONS = (
    ("experiments", "artifact_location"),
    ("runs", "artifact_uri"),
    ("logged_models", "artifact_location"),
    ("model_versions", "storage_location"),
)
"""Where MLflow's database holds absolute addresses of artifacts."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Store:
    """An open tracking store."""

    uri: str  # Tracking and registry URI
    root: Path  # Absolute root of the repository
    client: MlflowClient  # Talks to that URI
    experiment_id: str  # The default recipe's experiment; empty if only reading and it is not there

    def experiment(self, part: str) -> str:
        """Return the id of one of the project's experiments, made if it is not there; ``""`` is the default's."""
        return _experiment(self.client, self.uri, self.root, f"{EXPERIMENT}-{part}") if part else self.experiment_id

    def logged_model(self, version: ModelVersion) -> LoggedModel:
        """Return the logged model that was registered as this version."""
        return self.client.get_logged_model(str(version.source).removeprefix("models:/"))

    def log_metrics(self, run_id: str, metrics: Sequence[Metric]) -> None:
        """Log any number of metrics; a server takes only so many at a time."""
        for some in chunk_list(metrics, _METRICS_A_REQUEST):
            self.client.log_batch(run_id, metrics=some)


def tracking_uri(root: Path) -> str:
    """Return ``MLFLOW_TRACKING_URI`` if it is set, else SQLite at the repository's root by absolute path."""
    return os.environ.get(_VARIABLE) or _own_uri(repository_root(root))


def _own_uri(root: Path) -> str:
    return f"sqlite:///{root / 'mlflow.db'}"


def artifact_folder(root: Path) -> Path:
    """Return where the default store keeps its artifacts."""
    return repository_root(root) / "mlartifacts"


@contextmanager
def open_store(root: Path, *, create: bool = True, write: bool = False) -> Iterator[Store]:
    """Yield the store. With ``create`` it is made if it is not there. Who may ``write`` or ``create`` waits for others.

    The lock makes "look whether it is there, else log it" one step, and a killed process gives it back. Artifacts of
    the repository's own store are those of the repository as it lies now, also after it was moved or copied.

    Raises:
        TrackingError: There is no store, the server does not respond, MLflow cannot open it, or refuses what the block
            asks for.
    """
    uri, root, given = tracking_uri(root), repository_root(root), os.environ.get(_VARIABLE)
    _refuse_what_is_no_store(uri, create=create)
    with ExitStack() as stack:
        if create or write:
            stack.enter_context(_turn(root / LOCAL_FOLDER, uri))
        stack.callback(os.environ.update, {_VARIABLE: given} if given else {})
        stack.callback(mlflow.set_tracking_uri, None)  # type: ignore[arg-type]  # "ask the environment"
        _quiet()
        mlflow.set_tracking_uri(uri)  # MLflow's registry asks its own global for the store of models
        try:
            if uri == _own_uri(root):
                _make_whole(root)
                _follow_a_move(root)
            client = MlflowClient(tracking_uri=uri, registry_uri=uri)
            found = client.get_experiment_by_name(EXPERIMENT)
            experiment_id = _experiment(client, uri, root, EXPERIMENT) if create else found and found.experiment_id
        except Exception as error:  # of the server, of its database's driver, of a file
            advice = _CORRECT if given else "move it away, and `cylinder-friction track` makes one from the results"
            raise TrackingError(f"{uri} is no MLflow store that can be opened ({in_brief(error)}); {advice}") from error
        _quiet()  # creating the schema sets its own levels
        try:
            yield Store(uri, root, client, str(experiment_id or ""))
        except MlflowException as error:
            raise TrackingError(f"{uri}: MLflow refused a request ({in_brief(error)})") from error


@contextmanager
def _turn(folder: Path, uri: str) -> Iterator[None]:
    """Wait until no other process of this repository writes to the same store, and say for whom."""
    path = folder / f"tracking-{hashlib.sha256(uri.encode()).hexdigest()[:8]}.lock"
    holder = path.with_suffix(".holder")
    with ExitStack() as stack:
        if not stack.enter_context(locked(path, wait=False)):
            who = holder.read_text(encoding="utf-8") if holder.is_file() else "another process"
            _log.warning("waiting for %s, which writes to %s", who, uri)
            stack.enter_context(locked(path))
        holder.write_text(f"process {os.getpid()} ({' '.join([Path(sys.argv[0]).name, *sys.argv[1:]])})", "utf-8")
        yield


def _experiment(client: MlflowClient, uri: str, root: Path, name: str) -> str:
    found = client.get_experiment_by_name(name)
    if found is None:
        location = artifact_folder(root).as_uri() if uri.startswith("sqlite:") else None
        # The UI opens on the runs, not on traces of agents.
        tags = {"mlflow.experimentKind": "custom_model_development", "mlflow.note.content": _NOTE}
        try:
            return str(client.create_experiment(name, artifact_location=location, tags=tags))
        except MlflowException:  # another machine may have made it between the look and the creation
            found = client.get_experiment_by_name(name)
            if found is None:
                raise
    if found.lifecycle_stage == "deleted":
        client.restore_experiment(found.experiment_id)
    return str(found.experiment_id)


def _make_whole(root: Path) -> None:
    """Make the repository's own store if it is not there: aside, so that a kill leaves a whole one or none."""
    path = root / "mlflow.db"
    for left in root.glob(".mlflow.*.draft*"):
        left.unlink()
    if path.exists():
        return
    draft = root / f".mlflow.{uuid.uuid4().hex}.draft"
    try:
        SqlAlchemyStore(f"sqlite:///{draft}", artifact_folder(root).as_uri()).engine.dispose()
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def _follow_a_move(root: Path) -> None:
    """Let the repository's own store name the artifacts beside it: MLflow writes down where they lay at first."""
    here, query = artifact_folder(root).as_uri(), "SELECT artifact_location FROM experiments WHERE name = ?"
    with closing(sqlite3.connect(root / "mlflow.db", timeout=_LOCK_TIMEOUT_S)) as database, database:
        try:
            found = database.execute(query, (EXPERIMENT,)).fetchone()
        except sqlite3.DatabaseError:
            return  # it has no tables yet, or is no database, which MLflow refuses
        for table, column in _LOCATIONS if found is not None and found[0] != here else ():
            database.execute(
                f"UPDATE {table} SET {column} = ? || substr({column}, ?) "  # noqa: S608
                f"WHERE {column} = ? OR substr({column}, 1, ?) = ?",
                (here, len(found[0]) + 1, found[0], len(found[0]) + 1, f"{found[0]}/"),
            )


def _refuse_what_is_no_store(uri: str, *, create: bool) -> None:
    """MLflow makes a database at whatever path it gets, and retries for minutes if no server answers."""
    scheme = urlsplit(uri).scheme
    if scheme == "sqlite" and not create and not Path(uri.removeprefix("sqlite:///")).is_file():
        raise TrackingError(
            f"{uri}: there is no such store; run `dvc repro`, or `cylinder-friction track` if the results came from "
            "DVC, in the project's folder"
        )
    if scheme.partition("+")[0] not in (*_SERVERS, *DATABASE_ENGINES):
        raise TrackingError(
            f"MLFLOW_TRACKING_URI is {uri}, but expected http://, https:// or a database ({', '.join(DATABASE_ENGINES)}"
            "); correct it, or unset it to use the repository's own store"
        )
    if scheme not in _SERVERS:
        return
    try:
        answer = http_request(
            get_default_host_creds(uri), "/health", "GET", max_retries=0, timeout=ANSWER_TIMEOUT_S,
            raise_on_status=False,
        )  # fmt: skip
        answer.close()  # whether it is MLflow that answers shows soon
    except MlflowException as error:
        raise TrackingError(
            f"MLFLOW_TRACKING_URI is {uri}, but nothing responds there within {ANSWER_TIMEOUT_S:g} s "
            f"({in_brief(error)}); start the tracking server, correct the variable, or unset it to use the "
            "repository's own store"
        ) from error


def _quiet() -> None:
    for name in ("mlflow", "alembic", "sqlalchemy"):
        logging.getLogger(name).setLevel(logging.WARNING)
