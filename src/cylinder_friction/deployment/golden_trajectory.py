"""The golden trajectory of a served model: samples, and the estimator's outputs at registration.

The file lies beside the estimator. A model that does not reproduce it does not start.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array

GOLDEN_FILE = "golden.json"
TOLERANCE_N = 0.1
"""Largest accepted difference [N]; processors differ in rounding single precision."""


class GoldenError(ValueError):
    """A runtime does not reproduce the golden trajectory of its model."""


def difference_n(run: Callable[[Array], tuple[Array, NDArray[np.integer[Any]]]], golden: dict[str, Any]) -> float:
    """Run a runtime on a golden trajectory; return its largest difference from the recorded newtons [N].

    Raises:
        GoldenError: The difference exceeds ``TOLERANCE_N``, or flags differ.
    """
    newtons, flags = run(np.array(golden["samples"], dtype=np.float64))
    found_n = float(np.abs(newtons[:, :3] - np.array(golden["newtons"])).max())
    changed = int((flags != np.array(golden["flags"])).sum())
    if changed or not found_n <= TOLERANCE_N:
        raise GoldenError(
            f"on its golden trajectory it is {found_n:.3g} N from what was recorded with it, and {changed} flags "
            f"differ; expected at most {TOLERANCE_N} N and the same flags"
        )
    return found_n
