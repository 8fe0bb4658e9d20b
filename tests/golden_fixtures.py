"""The golden hybrid, a LuGre, and golden samples to step them through."""

from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.testing.golden import MODEL_FOLDER, read_trajectories

GOLDEN = Path(__file__).parent / "golden"


@pytest.fixture(scope="session")
def hybrid() -> HybridEstimator:
    estimator = load_estimator(GOLDEN / MODEL_FOLDER)
    assert isinstance(estimator, HybridEstimator)
    return estimator


@pytest.fixture(scope="session")
def golden_model() -> StepModel:
    return load_estimator(GOLDEN / MODEL_FOLDER).step_model()


@pytest.fixture(scope="session")
def lugre(cylinder: Cylinder, labelled_recordings: list[Recording]) -> LugreEstimator:
    estimator = LugreEstimator(cylinder, population=4, generations=1, simulated_recordings=1)
    estimator.fit(labelled_recordings[:1])
    return estimator


@pytest.fixture(scope="session")
def samples() -> np.ndarray:
    return read_trajectories(GOLDEN)["stick_slip_reversals"].samples[:400]
