"""The store of runs and models: SQLite in the repository, or a server that ``MLFLOW_TRACKING_URI`` names."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import mlflow
from mlflow import MlflowClient
from mlflow.exceptions import MlflowException
from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

from cylinder_friction.files.whole_files import locked, whole_file
from cylinder_friction.tracking.repository import TrackingError, repository_root
from cylinder_friction.wording import in_brief

EXPERIMENT = "cylinder-friction"
LOCAL_FOLDER = ".cylinder-friction"  # Folder of this machine's own files, neither versioned nor shared
_NOTE = (
    "A run is one execution of the pipeline, named after recipe, differences and commit. Below it are its stages and "
    "trials. `truth_error_percent/...` or `label_error_percent/...`, after what it is measured against, is the mean "
    "absolute error on held-out recordings [% of mean friction]. Smaller is better."
)
_VARIABLE = "MLFLOW_TRACKING_URI"


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
                if (found := self.client.get_experiment_by_name(name)) is None:
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
def open_store(root: Path, *, create: bool = True) -> Iterator[Store]:
    """Open the store; if it does not exist and ``create`` is true, make it first.

    Raises:
        TrackingError: The store does not exist or is that of a repository that was moved, the server does not respond,
            MLflow cannot open the store, or MLflow refuses a request of the block.
    """
    uri, root, given = tracking_uri(root), repository_root(root), os.environ.get(_VARIABLE)
    file = Path(uri.removeprefix("sqlite:///"))
    if uri.startswith("sqlite:") and not create and not (file.is_file() and file.stat().st_size):
        way = "run `dvc repro`, or `cylinder-friction track` if the results are there already, in the project's folder"
        raise TrackingError(f"{uri}: there is no such store, or an empty file; {way}")  # MLflow would fill it
    with ExitStack() as stack:
        stack.callback(os.environ.update, {_VARIABLE: given} if given else {})
        stack.callback(mlflow.set_tracking_uri, None)  # type: ignore[arg-type]  # "ask the environment"
        mlflow.set_tracking_uri(uri)  # MLflow's registry asks its own global for the store of models
        try:
            if not given and not (root / "mlflow.db").exists():
                _make_whole(root)
            store = Store(uri, root, client := MlflowClient(tracking_uri=uri, registry_uri=uri))
            found = client.get_experiment(store.experiment()) if create else client.get_experiment_by_name(EXPERIMENT)
            if create and not given and found and found.artifact_location != artifact_folder(root).as_uri():
                raise TrackingError(f"the repository was moved or copied from {found.artifact_location}")
        except Exception as error:  # from the server, its database driver or a file
            why = in_brief(error, 400)
            advice = _advice(why, uri, bool(given))
            raise TrackingError(f"{uri} is no MLflow store that can be opened ({why}); {advice}") from error
        try:
            yield store
        except MlflowException as error:
            raise TrackingError(f"{uri}: MLflow refused a request ({in_brief(error)})") from error


def _advice(why: str, uri: str, given: bool) -> str:
    """Advise what to do about a store that cannot be opened."""
    if "mlflow db upgrade" in why:
        return (
            "another version of MLflow made it; if that was newer, install it; if it was older, copy the database and "
            f"run `mlflow db upgrade {uri}`; both keep runs and promotions"
        )
    if given:
        return (
            f"start the server, correct {_VARIABLE} or the login in ~/.mlflow/credentials, or unset the variable "
            "to use the repository's own store"
        )
    return (
        "move it away, and `cylinder-friction track` makes one from the results, whose versions are not promoted: "
        "`cylinder-friction promote VERSION` makes one the champion"
    )


def _make_whole(root: Path) -> None:
    """Make the repository's own store; a kill leaves a complete store or none."""
    with locked(root / LOCAL_FOLDER / "store.lock"):
        if not (root / "mlflow.db").exists():  # another process may just have made it
            with whole_file(root / "mlflow.db") as draft:
                SqlAlchemyStore(f"sqlite:///{draft}", artifact_folder(root).as_uri()).engine.dispose()
