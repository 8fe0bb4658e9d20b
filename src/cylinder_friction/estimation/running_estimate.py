"""A saved model's real-time step over the parts of a recording, as if they were one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.arrays import Mask
from cylinder_friction.labelling.load import pooled_load
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.realtime.bounds import bounds_count
from cylinder_friction.realtime.flags import LEAST_ROWS, Flag
from cylinder_friction.realtime.stream import CompiledRun
from cylinder_friction.recordings.recording import Recording

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import Bounds

OFTEN_MISSED = 3.0
"""Bounds that miss the label this many times as often as they may are named."""


@lru_cache(maxsize=1)
def loaded_once(folder: Path) -> FrictionEstimator:
    from cylinder_friction.estimators.loading import load_estimator  # ONNX: labels need no estimator

    return load_estimator(folder)


def for_load(estimator: FrictionEstimator, identified: SessionIdentification | None) -> FrictionEstimator:
    """Return the estimator for the load of this session, where one is identified and it takes one by position."""
    if identified is None or identified.load is None or estimator.position_load is None:
        return estimator
    return estimator.with_position_load(pooled_load([identified.load]))


def label_missed(parts: Sequence[Recording], bounds: Bounds) -> str:
    """Return how seldom bounds hold the label of a recording, in words; empty if they hold it about as often as stated.

    Rows count as ``bounds_count`` states.
    """
    held: list[Mask] = [np.empty(0, dtype=np.bool_)]
    for part in parts:
        label_n = part.column("label_n")
        within = (part.column("lower_n") <= label_n) & (label_n <= part.column("upper_n"))
        held.append(within[bounds_count(part)])
    every = np.concatenate(held)
    share = float(every.mean()) if len(every) >= LEAST_ROWS else 1.0
    if 1.0 - share <= OFTEN_MISSED * (1.0 - bounds.probability):
        return ""
    return f"bounds hold the label in {100.0 * share:.0f} % of the rows, not in {100.0 * bounds.probability:.0f} %"


class RunningEstimate:
    """The estimator's real-time step, run over the parts of a recording as if they were one."""

    def __init__(self, estimator: FrictionEstimator) -> None:
        self.estimator, self.steps = estimator, CompiledRun(estimator.step_model())
        # What was given after the last part's own rows, for an estimate of some samples before
        self.newtons, self.flags = np.empty((0, 3)), np.empty(0, dtype=np.int64)

    def estimated(self, labelled: Recording, own: slice) -> Recording:
        """Return a part's own rows with friction, bounds and flags, and the label beside them.

        Rows before the first valid sample have no estimate: their friction is NaN, and they are not usable.
        """
        rows, end = own.stop - own.start, min(own.stop + self.estimator.lag_samples, len(labelled))
        samples = labelled.samples(self.estimator.inputs)[own.start + len(self.flags) : end]
        newtons, flags = self.steps.run(samples)
        newtons, flags = np.concatenate([self.newtons, newtons]), np.concatenate([self.flags, flags])
        self.newtons, self.flags = newtons[rows:], flags[rows:]
        known_n = np.where((flags & Flag.NOT_READY == 0)[:, None], newtons, np.nan)
        friction_n, lower_n, upper_n = self.estimator.aligned(known_n)[:rows].T
        part = labelled.rows(own)
        return part.with_columns(
            label_n=part.column("friction_n"),
            friction_n=friction_n,
            lower_n=lower_n,
            upper_n=upper_n,
            flags=flags[:rows],
            usable=part.usable() & np.isfinite(friction_n),
        )
