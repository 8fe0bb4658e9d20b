"""Which model is in service: a file names it, and the server exchanges models while it runs."""

import logging
from dataclasses import asdict, dataclass
from pathlib import Path

from cylinder_friction.deployment import golden_trajectory
from cylinder_friction.deployment.golden_trajectory import GoldenError, difference_n
from cylinder_friction.deployment.scoring import ServedGraph
from cylinder_friction.recordings.files import read_json, write_json
from cylinder_friction.service.access import file_stamp
from cylinder_friction.service.scoring.settings import ServingError

GRAPH_FILE = "artifacts/sequence.onnx"
GOLDEN_FILE = f"artifacts/{golden_trajectory.GOLDEN_FILE}"

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ServedModel:
    """A version of a registered model, and the folder that holds it."""

    folder: Path
    name: str
    version: str


def write_current(path: Path, model: ServedModel) -> None:
    """Make a model the one in service: workers that watch ``path`` exchange theirs within two seconds."""
    write_json(path, asdict(model) | {"folder": str(model.folder)})


def read_current(path: Path) -> ServedModel:
    """Return the model that ``path`` names.

    Raises:
        ServingError: The file is not there, or not as ``write_current`` writes it.
    """
    try:
        content = read_json(path)
        return ServedModel(Path(content["folder"]), str(content["name"]), str(content["version"]))
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ServingError(f"{path}: names no model ({type(error).__name__}: {error})") from error


@dataclass(frozen=True)
class ModelInService:
    """A model whose graph is open, and how far it is from its golden trajectory [N]."""

    model: ServedModel
    graph: ServedGraph
    golden_difference_n: float


def open_model(model: ServedModel) -> ModelInService:
    """Open a model's graph and run it on the golden trajectory in its folder.

    Raises:
        ServingError: Graph or trajectory is not there, or the graph's outputs are not the recorded ones.
    """
    try:
        graph, golden = ServedGraph(model.folder / GRAPH_FILE), model.folder / GOLDEN_FILE
        if not golden.is_file():
            raise GoldenError(f"its golden trajectory, {GOLDEN_FILE}, is not there")
        return ModelInService(model, graph, difference_n(graph.run, read_json(golden)))
    except GoldenError as error:
        raise ServingError(f"{model.name} version {model.version}: {error}; register the model again") from error
    except Exception as error:  # ONNX Runtime raises many kinds
        raise ServingError(f"{model.name} version {model.version}: its graph cannot be opened and run") from error


class ModelSource:
    """The model in service, exchanged when ``current_file`` changes.

    Attributes:
        now: The model in service.
        problem: Why the model that the file names is not the one in service, without any path; empty where it is.
        exchanges, refusals: How often models were exchanged, and refused.
    """

    def __init__(self, current_file: Path) -> None:
        """Open the model that the file names; raises ``ServingError`` where it cannot be served."""
        self._file, self._stamp = current_file, file_stamp(current_file)
        self.now = open_model(read_current(current_file))
        self.problem = ""
        self.exchanges = self.refusals = 0

    def refresh(self) -> None:
        """Exchange the model if the file names another; one that fails is refused, and the old one stays."""
        stamp = file_stamp(self._file)
        if stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            model = read_current(self._file)
        except ServingError as error:
            self._refuse("the file that names the model cannot be read", error)
            return
        try:
            if model != self.now.model:
                self.now = open_model(model)
                self.exchanges += 1
                _log.warning("%s version %s is in service", model.name, model.version)
            self.problem = ""
        except ServingError as error:
            self._refuse(str(error), error)

    def _refuse(self, problem: str, error: ServingError) -> None:
        self.problem = problem
        self.refusals += 1
        now = self.now.model
        _log.error("%s; %s version %s stays in service", problem, now.name, now.version, exc_info=error)
