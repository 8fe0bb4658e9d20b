"""The served model as MLflow runs it. MLflow copies this file into the logged model and executes it there.

It imports nothing of the package until it has found the code that the model brings along. Nothing is pickled.
"""

import hashlib
import json
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import mlflow
import pandas as pd
from mlflow.exceptions import MlflowException
from mlflow.protos.databricks_pb2 import INVALID_PARAMETER_VALUE
from mlflow.pyfunc.model import PythonModel

PACKAGE = "cylinder_friction"
SERVED = "__pyfunc_model_path__"  # Variable that MLflow sets for its server


class FrictionScoringModel(PythonModel):
    """Friction from rows of raw samples; see ``cylinder_friction.deployment.scoring.score_columns``."""

    def load_context(self, context: Any) -> None:
        """Load the estimator with the code that it was registered with, and run its golden trajectory.

        Raises:
            MlflowException: Other code of the package is imported already, files are damaged, or the step does not give
                what was recorded at registration. MLflow's server ends with the same sentence (``SystemExit``).
        """
        estimator, golden = (Path(context.artifacts[each]) for each in ("estimator", "golden"))
        code = estimator.parents[1] / "code"
        with _named(code):
            import_brought_code(code)
            from cylinder_friction.deployment.golden_trajectory import difference_n
            from cylinder_friction.deployment.scoring import ScoringError, ServedModel, score_frame
            from cylinder_friction.estimators.loading import load_estimator
        with _named(estimator):
            self._served = ServedModel(load_estimator(estimator).step_model())
        with _named(golden):
            difference_n(self._served.run, json.loads(golden.read_text("utf-8")))
        self._refused, self._score_frame = ScoringError, score_frame

    def predict(self, context: Any, model_input: pd.DataFrame, params: Any = None) -> pd.DataFrame:  # noqa: ARG002
        """Score rows like ``score_columns``, one result per row; rows that cannot be scored give 400."""
        try:
            return self._score_frame(self._served, model_input)
        except self._refused as error:
            raise MlflowException(str(error), error_code=INVALID_PARAMETER_VALUE) from error


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Refuse a model in one sentence that names the file or folder because of which it does not start."""
    try:
        yield
    except Exception as error:  # of a damaged file: anything
        own = isinstance(error, MlflowException)
        words = f"this model does not start, because of {path}: {str(error) or type(error).__name__}"
        words = str(error) if own else f"{words}; restore the file from a backup, or register the model again"
        if SERVED in os.environ:  # MLflow's server would print its own traceback
            raise SystemExit(words) from None
        raise MlflowException(words, error_code=INVALID_PARAMETER_VALUE) from error


def import_brought_code(code: Path) -> None:
    """Make imports give the packages in ``code``, a folder that MLflow put on the path: ours, and an estimator's own.

    Installed packages with the same files are used as they are. Otherwise the code is copied into the user's cache,
    into a folder that its hash names: Numba compiles it there once, whatever place the model is loaded from, and the
    model's own folder stays as it was registered.

    Raises:
        MlflowException: A package is imported already, with other code: Python would go on running that.
    """
    files = [path for path in code.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    names = sorted(path.relative_to(code).as_posix() for path in files)
    sys.path[:] = [each for each in sys.path if each != str(code)]
    same = True
    for package in sorted({name.split("/")[0] for name in names if ".dist-info/" not in name}):
        own = [name for name in names if name.split("/")[0] == package]
        top, wanted = package.removesuffix(".py"), _code_hash(code, own)
        imported = sys.modules.get(top)
        spec = PathFinder.find_spec(top) if imported is None else imported.__spec__
        there = None if spec is None or spec.origin is None else Path(spec.origin).parent
        if there is not None and package == top:  # a folder
            there = there.parent
        found = "" if there is None else _code_hash(there, own)
        # an estimator's package that nobody installed would not register its class
        stated = [name for name in names if ".dist-info/" in name] if package != PACKAGE else []
        registered = there is not None and _code_hash(there, stated) == _code_hash(code, stated)
        same = same and found == wanted and registered
        if imported is not None and found != wanted:
            raise MlflowException(
                f"this model brings {top} with code {wanted[:12]} along, but {there} with code {found[:12]} is "
                "imported already, and Python goes on running that; load the model in a process that has not imported "
                f"{top}, or serve it with `mlflow models serve`",
                error_code=INVALID_PARAMETER_VALUE,
            )
    if not same:
        sys.path.insert(0, str(_cached(code, names, _code_hash(code, names))))


def _code_hash(folder: Path, names: list[str]) -> str:
    """Hash these files of a folder; one that is missing counts as empty."""
    digest = hashlib.sha256()
    for name in names:
        path = folder / name
        digest.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes() if path.is_file() else b"").digest())
    return digest.hexdigest()


def _cached(code: Path, names: list[str], wanted: str) -> Path:
    """Copy the code into the user's cache, unless it lies there already; return the folder that holds it."""
    try:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        place = home / "cylinder-friction" / wanted[:32]
        if _code_hash(place, names) == wanted:
            return place
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=place.parent) as scratch:
            draft = _copied(code, names, Path(scratch) / "code")
            if place.exists():  # damaged
                shutil.rmtree(place)
            with suppress(OSError):  # another process has just put the same there
                draft.rename(place)
        return place
    except (OSError, RuntimeError) as error:  # a full disk, or an account without a home
        warnings.warn(
            f"the user's cache cannot be written ({error}), so that this model is compiled at every start, which takes "
            "seconds; set XDG_CACHE_HOME to a folder that only you can write",
            stacklevel=2,
        )
    return _copied(code, names, Path(tempfile.mkdtemp(prefix="cylinder-friction-")) / wanted[:32])


def _copied(code: Path, names: list[str], folder: Path) -> Path:
    """Copy files of the code into a folder, and return the folder."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(code / name, folder / name)
    return folder


mlflow.models.set_model(FrictionScoringModel())
