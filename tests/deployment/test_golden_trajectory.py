"""The golden trajectory of a served model: recorded by the compiled step, missed by any other model."""

import numpy as np
import pytest

from cylinder_friction.deployment.golden_recording import golden_content
from cylinder_friction.deployment.golden_trajectory import GoldenError, difference_n
from cylinder_friction.deployment.scoring import ServedModel
from cylinder_friction.realtime.model import StepModel


def test_an_estimator_meets_its_trajectory_bit_for_bit(small_model: StepModel) -> None:
    golden, guard = golden_content(small_model), small_model.guard
    samples = np.array(golden["samples"])
    assert samples.shape == (800, 3)
    assert (samples.min(axis=0) > guard.trained_lower).all()
    assert (samples.max(axis=0) < guard.trained_upper).all()
    assert np.ptp(golden["newtons"], axis=0).min() > 10.0
    assert difference_n(ServedModel(small_model).run, golden) == 0.0


def test_another_model_misses_it(small_model: StepModel) -> None:
    golden = golden_content(small_model)
    for change in ({"newtons": (np.array(golden["newtons"]) + 0.2).tolist()}, {"flags": [0] * 800}):
        with pytest.raises(GoldenError, match=r"on its golden trajectory it is .* N from .*; expected at most 0\.1 N"):
            difference_n(ServedModel(small_model).run, {**golden, **change})
