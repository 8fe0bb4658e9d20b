"""Models of every shape, each compiled once, and the samples that they are stepped through."""

import shutil
from collections.abc import Callable

import numpy as np
import pytest

from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import Precision, export_model
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.testing.golden import read_trajectories
from golden_fixtures import GOLDEN, golden_model
from learned_offset import learning_hybrid, offset_samples
from model_shapes import SHAPES

__all__ = ["compiled", "golden_model", "learning_hybrid", "offset_samples", "trajectories"]
COMPILERS = ("gcc", "clang")


@pytest.fixture(scope="session")
def trajectories() -> dict[str, np.ndarray]:
    """Raw samples of every golden trajectory, shape ``(n, 3)`` each."""
    return {name: trajectory.samples for name, trajectory in read_trajectories(GOLDEN).items()}


@pytest.fixture(scope="session")
def compiled(
    golden_model: StepModel, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str, Precision], CompiledEstimator]:
    """Return the compiled model of a shape and precision, each compiled once."""
    if not any(shutil.which(name) for name in COMPILERS):
        pytest.skip("no C compiler")
    made: dict[tuple[str, str], CompiledEstimator] = {}

    def compile_once(shape: str, precision: Precision = "double") -> CompiledEstimator:
        if (shape, precision) not in made:
            folder = tmp_path_factory.mktemp("c")
            exported = export_model(SHAPES[shape](golden_model), folder, precision=precision)
            made[shape, precision] = CompiledEstimator(exported)
        return made[shape, precision]

    return compile_once
