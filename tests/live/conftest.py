"""A small hybrid's engine, and samples for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from cylinder_friction.live.engine import Engine
from cylinder_friction.live.engine_building import built_engine

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.recordings.recording import Recording


@pytest.fixture(scope="session")
def engine(small_hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory) -> Engine:
    return Engine(built_engine(small_hybrid, tmp_path_factory.mktemp("engines")))


@pytest.fixture(scope="session")
def samples(labelled_recordings: list[Recording]) -> Array:
    return labelled_recordings[0].samples()


@pytest.fixture(scope="session")
def model(small_hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model") / "hybrid"
    small_hybrid.save(folder)
    return folder
