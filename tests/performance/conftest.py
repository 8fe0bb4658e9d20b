"""The scripts of performance/ as modules, and the golden model."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.testing.golden import MODEL_FOLDER, read_trajectories

if TYPE_CHECKING:
    import numpy as np

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.realtime.model import StepModel
    from cylinder_friction.recordings.recording import Recording

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests/golden"
sys.path.append(str(ROOT / "performance"))


@pytest.fixture(scope="session")
def hybrid() -> HybridEstimator:
    estimator = load_estimator(GOLDEN / MODEL_FOLDER)
    assert isinstance(estimator, HybridEstimator)
    return estimator


@pytest.fixture(scope="session")
def model(hybrid: HybridEstimator) -> StepModel:
    return hybrid.step_model()


@pytest.fixture(scope="session")
def lugre(cylinder: Cylinder, labelled_recordings: list[Recording]) -> LugreEstimator:
    estimator = LugreEstimator(cylinder, population=4, generations=1, simulated_recordings=1)
    estimator.fit(labelled_recordings[:1])
    return estimator


@pytest.fixture(scope="session")
def samples() -> np.ndarray:
    return read_trajectories(GOLDEN)["stick_slip_reversals"].samples[:400]
