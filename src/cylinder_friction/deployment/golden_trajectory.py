"""The golden trajectory of a served model: samples, and what the estimator made of them when it was registered.

It lies beside the estimator. A model that misses it does not start.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array

GOLDEN_FILE = "golden.json"
TOLERANCE_N = 0.1
"""Other processors round single precision otherwise."""


class GoldenError(ValueError):
    """A runtime does not give what was recorded with its model."""


def difference_n(run: Callable[[Array], tuple[Array, NDArray[np.integer[Any]]]], golden: dict[str, Any]) -> float:
    """Run a runtime on a golden trajectory; return how far it is from the recorded newtons at most [N].

    Raises:
        GoldenError: It is farther than ``TOLERANCE_N``, or flags differ.
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
