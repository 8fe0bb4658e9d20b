"""A repository with a champion, served once for all tests that ask it."""

import shutil
from pathlib import Path

import pytest

from cylinder_friction.dvc_hashes import dvc_hash, hashes_in
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.registry import register


@pytest.fixture(scope="session")
def champion_root(
    written_pipeline: Path, labelled_recordings: list[Recording], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A repository whose champion is the small hybrid; its store is its own, whatever MLFLOW_TRACKING_URI says."""
    root = tmp_path_factory.mktemp("served") / "repository"
    shutil.copytree(written_pipeline, root)
    first = labelled_recordings[0]
    candidate = Candidate(
        "friction-estimator",
        "models/hybrid",
        dvc_hash(root / "models/hybrid"),
        {"1": 2.0},
        "label",
        0.1,
        hashes_in(root),
        {"train": {"seed": 2}},
        {name: first.column(name)[:800].tolist() for name in ("pressure_1_pa", "pressure_2_pa", "position_m")},
        {"recipe": "default"},
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        register(candidate, root, lambda folder: {})
    return root
