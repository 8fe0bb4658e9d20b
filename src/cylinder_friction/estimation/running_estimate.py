"""Run a saved model's real-time step over a labelled recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.realtime.bounds import bounds_count
from cylinder_friction.realtime.flags import LEAST_ROWS, Flag
from cylinder_friction.realtime.stream import CompiledRun
from cylinder_friction.recordings.recording import Recording

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import Bounds

OFTEN_MISSED = 3.0
"""Bounds are reported if they miss the label this many times as often as stated."""


def label_missed(recording: Recording, bounds: Bounds) -> str:
    """State how rarely bounds contain a recording's label; empty if they contain it about as often as stated.

    ``bounds_count`` selects the rows.
    """
    label_n = recording.column("label_n")
    held = (recording.column("lower_n") <= label_n) & (label_n <= recording.column("upper_n"))
    held = held[bounds_count(recording)]
    share = float(held.mean()) if len(held) >= LEAST_ROWS else 1.0
    if 1.0 - share <= OFTEN_MISSED * (1.0 - bounds.probability):
        return ""
    return f"bounds hold the label in {100.0 * share:.0f} % of the rows, not in {100.0 * bounds.probability:.0f} %"


def estimated(labelled: Recording, estimator: FrictionEstimator) -> Recording:
    """Run an estimator's real-time step over a recording; add friction, bounds and flags, and keep the label.

    Rows before the first valid sample have no estimate: their friction is NaN, and they are not usable.
    """
    newtons, flags = CompiledRun(estimator.step_model()).run(labelled.samples(estimator.inputs))
    known_n = np.where((flags & Flag.NOT_READY == 0)[:, None], newtons, np.nan)
    friction_n, lower_n, upper_n = estimator.aligned(known_n).T
    return labelled.with_columns(
        label_n=labelled.column("friction_n"),
        friction_n=friction_n,
        lower_n=lower_n,
        upper_n=upper_n,
        flags=flags,
        usable=labelled.usable() & np.isfinite(friction_n),
    )
