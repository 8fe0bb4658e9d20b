"""The golden trajectory of a served model: recorded by the compiled step, missed by any other model."""

from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.deployment.golden_trajectory import GoldenError, check_golden, recorded
from cylinder_friction.deployment.scoring import ServedModel
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.files import write_json


def test_an_estimator_meets_its_trajectory_bit_for_bit(small_model: StepModel, tmp_path: Path) -> None:
    golden, guard = recorded(small_model), small_model.guard
    samples = np.array(golden["samples"])
    assert samples.shape == (800, 3)
    assert (samples.min(axis=0) > guard.trained_lower).all()
    assert (samples.max(axis=0) < guard.trained_upper).all()
    assert np.ptp(golden["newtons"], axis=0).min() > 10.0
    write_json(tmp_path / "golden.json", golden)
    assert check_golden(ServedModel(small_model).run, tmp_path / "golden.json") == 0.0


def test_another_model_misses_it(small_model: StepModel, tmp_path: Path) -> None:
    golden = recorded(small_model)
    for change in ({"newtons": (np.array(golden["newtons"]) + 0.2).tolist()}, {"flags": [0] * 800}):
        write_json(tmp_path / "golden.json", {**golden, **change})
        with pytest.raises(GoldenError, match=r"on its golden trajectory it is .* N from .*; expected at most 0\.1 N"):
            check_golden(ServedModel(small_model).run, tmp_path / "golden.json")
