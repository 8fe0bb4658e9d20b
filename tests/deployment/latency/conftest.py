"""A small hybrid and a LuGre, and samples to step them through."""

import shutil

import numpy as np
import pytest

from cylinder_friction.deployment.latency.measuring import Effort, Measured, measure
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from golden_fixtures import hybrid, lugre, samples
from learned_offset import learning_hybrid, offset_samples

STEPS = 50
__all__ = ["hybrid", "learning_hybrid", "lugre", "measured", "offset_samples", "samples"]


@pytest.fixture(scope="session")
def measured(hybrid: HybridEstimator, lugre: LugreEstimator, samples: np.ndarray) -> Measured:
    if shutil.which("gcc") is None:
        pytest.skip("there is no C compiler")
    effort = Effort(steps=STEPS, rounds=5, seconds=60.0)
    return measure({"small": hybrid, "lugre": lugre}, {"small": samples, "lugre": samples}, effort)
