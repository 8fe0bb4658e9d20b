"""The golden model in every shape that a step can have, and samples with everything wrong that can be."""

import numpy as np
import pytest

from cylinder_friction.realtime.model import StepModel
from cylinder_friction.testing.golden import read_trajectories
from golden_fixtures import GOLDEN, golden_model
from learned_offset import offset_samples
from model_shapes import SHAPES

__all__ = ["golden_model", "model", "offset_samples", "samples"]


@pytest.fixture(params=sorted(SHAPES))
def model(request: pytest.FixtureRequest, golden_model: StepModel) -> StepModel:
    return SHAPES[request.param](golden_model)


@pytest.fixture(scope="session")
def samples() -> np.ndarray:
    """All golden trajectories one after the other, begun with a sensor that is not there yet."""
    parts = [trajectory.samples for _, trajectory in sorted(read_trajectories(GOLDEN).items())]
    every = np.concatenate([part[:900] for part in parts])
    every[:3, 1] = np.nan
    every[3, 2] = np.inf
    every[1500:1530, 0] = 1e9
    return every
