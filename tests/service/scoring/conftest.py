"""A small model behind HTTP, as one worker serves it."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, recorded
from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.scoring import ServedGraph
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.files import write_json
from cylinder_friction.service.scoring.model_source import GRAPH_FILE, ServedModel, write_current
from cylinder_friction.service.scoring.settings import ServeSettings
from malformed_requests import SETTINGS, serving


@pytest.fixture(scope="session")
def model_folder(small_model: StepModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What of a model's folder is served."""
    graph = tmp_path_factory.mktemp("served") / GRAPH_FILE
    graph.parent.mkdir(parents=True)
    graph.write_bytes(sequence_graph(small_model).SerializeToString())
    write_json(graph.with_name(GOLDEN_FILE), recorded(ServedGraph(graph), small_model))
    return graph.parents[1]


@pytest.fixture
def current(model_folder: Path, tmp_path: Path) -> Path:
    """A file that names the small model as the one in service."""
    write_current(tmp_path / "current.json", ServedModel(model_folder, "friction-estimator", "7"))
    return tmp_path / "current.json"


@pytest.fixture
def serve(current: Path) -> Callable[..., AbstractContextManager[Any]]:
    """Return what serves the small model with the settings it is given."""

    @contextmanager
    def started(**settings: Any) -> Iterator[Any]:
        with serving(ServeSettings(**settings), current) as server:
            yield server

    return started


@pytest.fixture(scope="session")
def server(model_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The small model with the limits of the table of malformed requests."""
    current = tmp_path_factory.mktemp("current") / "current.json"
    write_current(current, ServedModel(model_folder, "friction-estimator", "7"))
    with serving(SETTINGS, current) as started:
        yield started
