"""The model in service: opened from a folder, exchanged when a file names another, kept where that one is bad."""

import json
import shutil
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.service.scoring.model_source import (
    GOLDEN_FILE,
    GRAPH_FILE,
    ModelSource,
    ServedModel,
    open_model,
    read_current,
    write_current,
)
from cylinder_friction.service.scoring.settings import ServingError


@pytest.fixture
def other(model_folder: Path, tmp_path: Path) -> ServedModel:
    shutil.copytree(model_folder, tmp_path / "other")
    return ServedModel(tmp_path / "other", "friction-estimator", "8")


def with_golden(model: ServedModel, off_n: float = 0.0, flags: int = 0) -> None:
    """Record a golden trajectory beside a model, so far from what it gives."""
    samples = np.tile([1.2e6, 9.1e5, 0.12], (20, 1))
    newtons, found = open_model(model).graph.run(samples)
    golden = {"samples": samples.tolist(), "newtons": (newtons[:, :3] + off_n).tolist()}
    (model.folder / GOLDEN_FILE).write_text(json.dumps({**golden, "flags": (found + flags).tolist()}))


def test_a_model_whose_golden_trajectory_was_deleted_is_refused(other: ServedModel) -> None:
    (other.folder / GOLDEN_FILE).unlink()
    with pytest.raises(ServingError, match=r"version 8: its golden trajectory, .*golden.json, is not there; register"):
        open_model(other)


@pytest.mark.parametrize(
    ("off_n", "flags", "message"),
    [
        (0.2, 0, "version 8: on its golden trajectory it is 0.2 N from what was recorded with it, and 0 flags differ"),
        (float("nan"), 0, "it is nan N from"),
        (0.0, 4, "it is 0 N from what was recorded with it, and 20 flags differ; expected at most 0.1 N and the same"),
    ],
)
def test_a_model_that_misses_it_is_refused(other: ServedModel, off_n: float, flags: int, message: str) -> None:
    with_golden(other, off_n, flags)
    with pytest.raises(ServingError, match=message):
        open_model(other)


def test_a_bad_model_leaves_the_old_one_in_service(current: Path, other: ServedModel) -> None:
    source = ModelSource(current)
    (other.folder / GRAPH_FILE).write_bytes(b"no graph")
    write_current(current, other)
    source.refresh()
    assert source.now.model.version == "7"
    assert source.problem == "friction-estimator version 8: its graph cannot be opened and run"
    current.write_text("{")
    source.refresh()
    assert (source.problem, source.refusals) == ("the file that names the model cannot be read", 2)
    write_current(current, ServedModel(source.now.model.folder, "f", "9"))
    source.refresh()
    assert (source.now.model.version, source.problem) == ("9", "")


@pytest.mark.parametrize("content", ["", "[]", '{"folder": "x"}', "\x00"])
def test_a_file_that_names_no_model_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "current.json").write_text(content)
    with pytest.raises(ServingError, match=r"current\.json: names no model"):
        read_current(tmp_path / "current.json")
    with pytest.raises(ServingError, match=r"nowhere\.json: names no model \(FileNotFoundError"):
        ModelSource(tmp_path / "nowhere.json")


def test_the_server_exchanges_its_model_and_shows_what_it_refused(
    serve: Callable[..., AbstractContextManager[Any]], current: Path, other: ServedModel
) -> None:
    def ready(wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        for _ in range(100):
            shown: dict[str, Any] = server.get("/readyz").json()
            if wanted(shown):
                break
            time.sleep(0.05)
        return shown

    with serve() as server:
        with_golden(other)
        write_current(current, other)
        assert ready(lambda shown: shown["version"] == "8")["golden_trajectory"] == "met"
        with_golden(other, off_n=5.0)
        write_current(current, ServedModel(other.folder, other.name, "9"))
        shown = ready(lambda shown: shown["refused"] is not None)
        assert shown["version"] == "8"
        assert shown["refused"].startswith("friction-estimator version 9: on its golden trajectory it is 5 N from")
        assert str(other.folder) not in json.dumps(shown)
        assert b"cylinder_friction_model_refused 1.0\n" in server.get("/metrics").body
        assert b"cylinder_friction_model_exchanges 1.0\n" in server.get("/metrics").body
