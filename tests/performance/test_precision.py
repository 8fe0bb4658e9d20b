"""What the script prints of two precisions: rounding alone for equal samples, and rows in which samples differ."""

from pathlib import Path

import numpy as np
from precision import differences

from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.hybrid import HybridEstimator


def test_rows_that_differ_are_counted(hybrid: HybridEstimator, samples: np.ndarray, tmp_path: Path) -> None:
    double = CompiledEstimator(export_c(hybrid, tmp_path / "double"))
    single = CompiledEstimator(export_c(hybrid, tmp_path / "float", precision="float"))
    rounded = samples.astype(np.float32).astype(np.float64)
    rows, friction_n, bounds_n, flags = differences(double, single, rounded, rounded)
    assert (rows, flags) == (0, 0)
    assert 0.0 < friction_n < 1e-4 > bounds_n > 0.0
    more = rounded + np.array([1e5, 0.0, 0.0])
    rows, friction_n, _, _ = differences(double, single, rounded, more)
    assert rows > 0.9 * len(samples)
    assert friction_n > 100.0
