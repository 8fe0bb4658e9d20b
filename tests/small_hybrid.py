"""Fixtures: more recordings of ``made_recordings``, and a hybrid trained on them."""

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.recordings.recording import Recording
from made_recordings import take_of_each_condition


@pytest.fixture(scope="session")
def twelve_recordings(cylinder: Cylinder, labelled_recordings: list[Recording]) -> list[Recording]:
    """The same with a third of each."""
    return [*labelled_recordings, *take_of_each_condition(cylinder, (3,))]


@pytest.fixture(scope="session")
def small_hybrid(cylinder: Cylinder, labelled_recordings: list[Recording]) -> HybridEstimator:
    """A hybrid of both parts, trained for two epochs: everything a real one has, only bad at its task."""
    hybrid = HybridEstimator(
        cylinder,
        "force_balance",
        Architecture(1, 8, 0.0, 1e-3),
        TrainingPlan(2, 2, 200, 20, 4),
        ForestPlan(4, 5, 2000, 20),
    )
    hybrid.fit(labelled_recordings)
    return hybrid
