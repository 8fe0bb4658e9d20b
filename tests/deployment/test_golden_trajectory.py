"""The golden trajectory of a served model: recorded by the compiled step."""

import numpy as np

from cylinder_friction.deployment.golden_recording import golden_content
from cylinder_friction.deployment.golden_trajectory import difference_n
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
