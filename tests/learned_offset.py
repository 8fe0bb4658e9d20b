"""An offset tracker with a number in every place, a hybrid that has one, and samples of sensors whose zeros are off."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OffsetSettings, OffsetTracker
from cylinder_friction.recordings.recording import Recording

PRIOR_N = 80.0
DOUBT = 0.74
SPREAD_N = (25.0, 15.0, 20.0, 0.0)
LIMITS = {
    **{"force_weights": (3.117e-3, -2.501e-3, 0.0), "clear_samples": 40},
    **{"sliding_lower": (20.0, 2e-5), "sliding_upper": (700.0, 2e-5), "largest_force": (720.0, 1e-5)},
}
"""A range of the force balance with a number in every place, that holds friction and the sensors' zeros."""
ZEROS_PA = np.array([2e4, -1.5e4])
"""What the pressure sensors of ``offset_samples`` read too much: 99.9 N."""


def made_tracker(load: tuple[float, ...] = ()) -> OffsetTracker:
    """Return a tracker that roughly knows friction in ``labelled_recordings``; some blocks lie beyond its ranges.

    ``load`` is the weight of a measured load in the force balance, if there is one behind pressures and position.
    """
    areas = np.array([3.117e-3, -2.501e-3, 0.0, *load])
    share = np.abs(areas) / np.abs(areas[:3]).sum() * (np.arange(len(areas)) < 3)
    zeros = np.array([2.2e4, 2.2e4, 0.0, *(30.0 for _ in load)])
    friction = [4.2e-5, 6e-3, 1350.0, 1.5, 0.2, 2e-2, 3e-2, 0.05, 1e-3, 3e-8, 2e-5, -0.4, 0.02, 3e-3]
    # Slowest speed, settling, block, mass, duration, noise, stroke, walk, common uncertainty, mean and deviation of
    # speed, first and last position, even part, caution, largest variance
    settings = [6e-3, 40, 20, 6.0, 0.1, 6.0, 3.0, PRIOR_N**2 * 0.005 / 3600.0, 2.5, 0.05, 0.02, 0.08, 0.17, 0.8]
    return OffsetTracker(
        weights=np.array([areas, share, 1e-3 * areas, 1e-5 * share, areas * (zeros / PRIOR_N) ** 2]),
        settings=OffsetSettings(*map(float, settings), -3e-7, 1.6, PRIOR_N**2),
        friction=np.array(friction),
        position=np.array([215.0, 1.0, -2.0, 0.5, 0.8, -0.3, 0.2, 0.6, -0.7, 0.1, 0.4, -0.2, 0.3]),
        ranges=np.array([[-1e6, 0.0, -1e30, -60.0], [6e6, 0.085, 1e30, 60.0]]),
        prior=np.array([PRIOR_N, 0.01, 0.08, 0.05, 0.0]),
    )


def doubting(model: StepModel) -> StepModel:
    """Return ``learning`` that finds a session unlike training as soon as it is a little so, and changes its mind."""
    model = learning(model)
    assert model.offset is not None
    settings = model.offset.settings._replace(scale_support=DOUBT / 0.08**2, slope_support=DOUBT / 0.05**2)
    return replace(model, offset=model.offset._replace(settings=settings))


def learning(model: StepModel) -> StepModel:
    """Return a step model that learns the offset too, with bounds that follow it, and knows the range of the force."""
    guard, bounds = replace(model.guard, **LIMITS), replace(model.bounds, spread_n=SPREAD_N)
    return replace(model, offset=made_tracker(), guard=guard, bounds=bounds)


@pytest.fixture(scope="session")
def learning_hybrid(small_hybrid: HybridEstimator) -> HybridEstimator:
    """The small hybrid with a tracker, bounds that follow it, and a range of the force that holds it."""
    hybrid = copy.copy(small_hybrid)
    model = learning(small_hybrid.step_model())
    hybrid.offset, hybrid.guard, hybrid.bounds = model.offset, model.guard, model.bounds
    return hybrid


@pytest.fixture(scope="session")
def offset_samples(labelled_recordings: list[Recording]) -> np.ndarray:
    """Forty seconds of a rest and strokes in both directions, shape ``(8000, 3)``, some readings being none."""
    samples = np.concatenate([recording.samples() for recording in labelled_recordings[:2]])
    samples[:60, 2] = samples[60, 2]
    samples[:, :2] += ZEROS_PA
    samples[0, 1], samples[900:905, 0], samples[2500, 2], samples[5000:5040] = np.nan, np.inf, -1e9, np.nan
    samples[6000:6200, 1] = samples[6000, 1]
    return samples
