"""A repository with a champion, served once for all tests that ask it."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from candidates import candidate_in
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.tracking.registry import register


@pytest.fixture(scope="session")
def champion_root(
    written_pipeline: Path, labelled_recordings: list[Recording], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A repository whose champion is the small hybrid; its store is its own, whatever MLFLOW_TRACKING_URI says."""
    root = tmp_path_factory.mktemp("served") / "repository"
    shutil.copytree(written_pipeline, root)
    first = labelled_recordings[0]
    example = {name: first.column(name)[:800].tolist() for name in SAMPLE_COLUMNS}
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        register(replace(candidate_in(root), example=example), root, lambda folder: {})
    return root
