"""A store and a repository of one's own for every test."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="session")
def empty_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with its schema and nothing in it; copying it spares every test the seconds of making one."""
    from mlflow import MlflowClient

    path = tmp_path_factory.mktemp("store") / "mlflow.db"
    MlflowClient(f"sqlite:///{path}").search_experiments()
    return path


@pytest.fixture
def root(tmp_path: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty repository with an empty store."""
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.delenv("DVC_EXP_NAME", raising=False)
    shutil.copy(empty_store, tmp_path / "mlflow.db")
    (tmp_path / ".dvc").mkdir()
    return tmp_path


@pytest.fixture
def pipeline(tmp_path: Path, written_pipeline: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository as the pipeline leaves it before ``register``, with an empty store."""
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    copy = tmp_path / "repository"
    shutil.copytree(written_pipeline, copy)
    shutil.copy(empty_store, copy / "mlflow.db")
    return copy
