"""Types of arrays, for annotations, and the runs of a mask."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def true_runs(mask: Mask) -> NDArray[np.int64]:
    """Return the first place of each run of true values and the one behind its last, shape ``(runs, 2)``."""
    return np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
