"""An estimator's errors by condition, measured on stored recordings."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.evaluation.metrics import errors
from cylinder_friction.recordings.truth import known_truth

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.evaluation.reported import Reference
    from cylinder_friction.recordings.recording import Recording


def errors_by_condition(
    estimator: FrictionEstimator, recordings: Iterable[Recording], reference: Reference, truth_folder: str
) -> dict[str, float]:
    """Measure an estimator's error in each condition [percent of mean |friction|], against label or truth."""
    known: defaultdict[str, list[Array]] = defaultdict(list)
    for recording in recordings:
        truth_n = {recording.name: recording.column("friction_n")}
        if reference == "truth":
            truth_n = known_truth(truth_folder, [recording])
        if recording.name in truth_n:
            both = np.stack([truth_n[recording.name], estimator.estimate(recording)])
            known[recording.metadata.condition].append(both[:, recording.usable()])
    joined = {condition: np.concatenate(known[condition], axis=1) for condition in sorted(known)}
    every = {condition: np.ones(both.shape[1], dtype=np.bool_) for condition, both in joined.items()}
    return {name: errors(both[0], both[1], every[name]).percent for name, both in joined.items()}
