"""A store and a repository of one's own for every test."""

import shutil
from pathlib import Path

import pytest

from candidates import registered_in


@pytest.fixture
def root(tmp_path: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty repository with an empty store."""
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.delenv("DVC_EXP_NAME", raising=False)
    shutil.copy(empty_store, tmp_path / "mlflow.db")
    (tmp_path / ".dvc").mkdir()
    return tmp_path


@pytest.fixture
def pipeline(tmp_path: Path, written_pipeline: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository as the pipeline leaves it before ``register``, with an empty store."""
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    copy = tmp_path / "repository"
    shutil.copytree(written_pipeline, copy)
    return copy


@pytest.fixture(scope="session")
def with_champion(tmp_path_factory: pytest.TempPathFactory, written_pipeline: Path) -> Path:
    """The same after ``register`` has promoted its model; read only."""
    copy = tmp_path_factory.mktemp("registered") / "repository"
    shutil.copytree(written_pipeline, copy)
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        registered_in(copy)
    return copy
