"""A single figure for an estimator's error, for searching and training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.recordings.recording import Recording


def mean_absolute_error_n(estimator: FrictionEstimator, recordings: Sequence[Recording]) -> float:
    """Compute the mean absolute error against the label [N] over the usable rows of all recordings together."""
    errors = [
        np.abs(estimator.estimate(recording) - recording.column("friction_n"))[recording.usable()]
        for recording in recordings
    ]
    return float(np.mean(np.concatenate(errors)))
