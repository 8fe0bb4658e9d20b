"""A finished smoke pipeline, run once for all tests of this folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from pipeline_workspace import MAKE, new_repository, run

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="session")
def finished_pipeline(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root of a repository in which the smoke recipe has run to the end; do not change it, copy it."""
    folder = new_repository(tmp_path_factory.mktemp("smoke"))
    assert "figures" in run(folder, *MAKE, "reproduce").stdout
    return folder
