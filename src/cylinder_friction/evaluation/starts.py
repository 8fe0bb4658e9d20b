"""The gain from a known sensor offset: starts with the offset of a session's earlier recording, and without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.evaluation.metrics import errors
from cylinder_friction.realtime.stream import CompiledRun
from cylinder_friction.recordings.recording import Recording


@dataclass(frozen=True)
class Starts:
    """Errors in one condition, over all recordings except the first of each session [% of mean |reference|]."""

    condition: str
    reference: str  # ``label`` or ``truth``
    recordings: int
    mean_abs_friction_n: float  # The denominator [N]
    cold_percent: float  # Started with only the stated uncertainty of the sensors' zeros
    warm_percent: float  # Started from the offset learned in the session's previous recording


def starts(estimator: FrictionEstimator, recordings: Sequence[Recording], truth_n: Mapping[str, Array]) -> list[Starts]:
    """Compare the errors of both starts by condition; empty if no offset is learned.

    Args:
        estimator: Fitted.
        recordings: Held-out recordings with ``friction_n`` and ``usable``; within a session their names are in order.
        truth_n: True friction [N] by recording name; the reference if known for all, otherwise the label is.
    """
    if estimator.offset is None:
        return []
    reference = "truth" if all(recording.name in truth_n for recording in recordings) else "label"
    found: dict[str, list[tuple[Array, Array, Array]]] = {}
    learned: dict[str, tuple[float, float]] = {}
    stream = CompiledRun(estimator.step_model().for_recordings())
    for recording in sorted(recordings, key=lambda each: each.name):
        session, usable = recording.metadata.session, recording.usable()
        known_n = truth_n[recording.name] if reference == "truth" else recording.column("friction_n")
        stream.reset(*learned.get(session, ()))
        warm_n = estimator.aligned(stream.run(recording.samples(estimator.inputs))[0])[:, 0]
        if session in learned:
            rows = (known_n[usable], estimator.estimate(recording)[usable], warm_n[usable])
            found.setdefault(recording.metadata.condition, []).append(rows)
        learned[session] = stream.offset
    return [_starts(condition, reference, found[condition]) for condition in sorted(found)]


def _starts(condition: str, reference: str, rows: Sequence[tuple[Array, Array, Array]]) -> Starts:
    known_n, cold_n, warm_n = (np.concatenate(each) for each in zip(*rows, strict=True))
    cold, warm = (errors(known_n, each, np.ones(len(known_n), dtype=np.bool_)) for each in (cold_n, warm_n))
    return Starts(condition, reference, len(rows), cold.mean_abs_friction_n, cold.percent, warm.percent)
