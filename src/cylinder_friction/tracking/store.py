"""The store of runs and models: SQLite in the repository, or a server that ``MLFLOW_TRACKING_URI`` names."""

import hashlib
import logging
import os
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import mlflow
from mlflow import MlflowClient
from mlflow.exceptions import MlflowException
from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

from cylinder_friction.files.locks import locked
from cylinder_friction.tracking.repository import TrackingError, repository_root
from cylinder_friction.wording import in_brief

EXPERIMENT = "cylinder-friction"
LOCAL_FOLDER = ".cylinder-friction"  # Folder of this machine's own files, neither versioned nor shared
_NOTE = (
    "Each top-level run is one execution of the pipeline, named after recipe, differences and commit. "
    "It states seeds, sessions, rows and how far its model is off on held-out recordings, as mean absolute error [% of "
    "mean friction]: `truth_error_percent/...` or `label_error_percent/...`, after what it is measured against. "
    "Smaller is better. Below each run are its stages, below the search its trials."
)
_VARIABLE = "MLFLOW_TRACKING_URI"
_LOCATIONS = (
    ("experiments", "artifact_location"),
    ("runs", "artifact_uri"),
    ("logged_models", "artifact_location"),
    ("model_versions", "storage_location"),
)
"""Tables and columns of MLflow's database that hold absolute addresses of artifacts."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Store:
    """An open tracking store."""

    uri: str  # Tracking and registry URI
    root: Path  # Absolute root of the repository
    client: MlflowClient  # Client of that URI

    def experiment(self, part: str = "") -> str:
        """Find the id of a recipe's experiment (``""``: default); make the experiment, or restore it if deleted."""
        name = f"{EXPERIMENT}-{part}" if part else EXPERIMENT
        found = self.client.get_experiment_by_name(name)
        if found is None:
            location = artifact_folder(self.root).as_uri() if self.uri.startswith("sqlite:") else None
            # With this kind, the UI opens on the runs, not on traces of agents.
            tags = {"mlflow.experimentKind": "custom_model_development", "mlflow.note.content": _NOTE}
            try:
                return str(self.client.create_experiment(name, artifact_location=location, tags=tags))
            except MlflowException:  # another machine may have made it since the look-up
                found = self.client.get_experiment_by_name(name)
                if found is None:
                    raise
        if found.lifecycle_stage == "deleted":
            self.client.restore_experiment(found.experiment_id)
        return str(found.experiment_id)


def tracking_uri(root: Path) -> str:
    """Look up ``MLFLOW_TRACKING_URI``; if it is not set, return the URI of SQLite at the repository's root."""
    return os.environ.get(_VARIABLE) or f"sqlite:///{repository_root(root) / 'mlflow.db'}"


def artifact_folder(root: Path) -> Path:
    """Find the artifact folder of the repository's own store."""
    return repository_root(root) / "mlartifacts"


@contextmanager
def open_store(root: Path, *, create: bool = True, write: bool = False) -> Iterator[Store]:
    """Open the store; if it does not exist and ``create`` is true, make it first.

    Processes that ``write`` or ``create`` hold a lock, so that "look for a run, else log it" is one step; a killed
    process releases the lock. If the repository was moved or copied, the store's addresses are updated.

    Raises:
        TrackingError: The store does not exist, the server does not respond, MLflow cannot open the store, or MLflow
            refuses a request of the block.
    """
    uri, root, given = tracking_uri(root), repository_root(root), os.environ.get(_VARIABLE)
    if uri.startswith("sqlite:") and not create and not Path(uri.removeprefix("sqlite:///")).is_file():
        raise TrackingError(  # MLflow would make an empty database
            f"{uri}: there is no such store; run `dvc repro`, or `cylinder-friction track` if the results came from "
            "DVC, in the project's folder"
        )
    with ExitStack() as stack:
        if create or write:
            stack.enter_context(_turn(root / LOCAL_FOLDER, uri))
        stack.callback(os.environ.update, {_VARIABLE: given} if given else {})
        stack.callback(mlflow.set_tracking_uri, None)  # type: ignore[arg-type]  # "ask the environment"
        mlflow.set_tracking_uri(uri)  # MLflow's registry asks its own global for the store of models
        _quiet()
        try:
            if not given:
                _make_whole(root)
                _follow_a_move(root)
            store = Store(uri, root, MlflowClient(tracking_uri=uri, registry_uri=uri))
            _ = store.experiment() if create else store.client.get_experiment_by_name(EXPERIMENT)
        except Exception as error:  # from the server, its database driver or a file
            advice = (
                f"start the server, correct {_VARIABLE} or the login in ~/.mlflow/credentials, or unset the variable "
                "to use the repository's own store"
                if given
                else "move it away, and `cylinder-friction track` makes one from the results"
            )
            why = in_brief(error, 400)
            raise TrackingError(f"{uri} is no MLflow store that can be opened ({why}); {advice}") from error
        _quiet()  # creating the schema sets its own levels
        try:
            yield store
        except MlflowException as error:
            raise TrackingError(f"{uri}: MLflow refused a request ({in_brief(error)})") from error


@contextmanager
def _turn(folder: Path, uri: str) -> Iterator[None]:
    """Hold the lock for writing to a store; log a warning that names the process that holds it, then wait."""
    path = folder / f"tracking-{hashlib.sha256(uri.encode()).hexdigest()[:8]}.lock"
    holder = path.with_suffix(".holder")
    with ExitStack() as stack:
        if not stack.enter_context(locked(path, wait=False)):
            who = holder.read_text(encoding="utf-8") if holder.is_file() else "another process"
            _log.warning("waiting for %s, which writes to %s", who, uri)
            stack.enter_context(locked(path))
        holder.write_text(f"process {os.getpid()} ({' '.join([Path(sys.argv[0]).name, *sys.argv[1:]])})", "utf-8")
        yield


def _make_whole(root: Path) -> None:
    """Make the repository's own store if it does not exist; a kill leaves a complete store or none."""
    if not (root / "mlflow.db").exists():
        draft = root / ".mlflow.db.draft"
        for left in root.glob(f"{draft.name}*"):
            left.unlink()
        SqlAlchemyStore(f"sqlite:///{draft}", artifact_folder(root).as_uri()).engine.dispose()
        draft.replace(root / "mlflow.db")


def _follow_a_move(root: Path) -> None:
    """Update the artifact addresses in the repository's own store, because MLflow stores their first absolute path."""
    here, query = artifact_folder(root).as_uri(), "SELECT artifact_location FROM experiments WHERE name = ?"
    with closing(sqlite3.connect(root / "mlflow.db", timeout=30.0)) as database, database:
        (there,) = database.execute(query, (EXPERIMENT,)).fetchone() or (here,)
        for table, column in _LOCATIONS if there != here else ():
            database.execute(f"UPDATE {table} SET {column} = replace({column}, ?, ?)", (there, here))  # noqa: S608


def _quiet() -> None:
    for name in ("mlflow", "alembic", "sqlalchemy"):
        logging.getLogger(name).setLevel(logging.WARNING)
    logging.getLogger("urllib3.connectionpool").setLevel(logging.ERROR)  # a retry needs no message
