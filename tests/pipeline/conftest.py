"""A finished smoke pipeline, run once for all tests of this folder."""

from pathlib import Path

import pytest

from pipeline_workspace import MAKE, new_repository, run


@pytest.fixture(scope="session")
def finished_pipeline(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root of a repository in which the smoke recipe has run to the end; do not change it, copy it."""
    folder = new_repository(tmp_path_factory.mktemp("smoke"))
    assert "figures" in run(folder, *MAKE, "reproduce").stdout
    return folder
