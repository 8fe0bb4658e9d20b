"""Adaptation of a hybrid to another cylinder: training plan, inputs, and what the recordings must hold.

Each choice was measured on a simulated rig of another structure with ten minutes of recordings (see the guide on a new
cylinder). It is better to standardise features and target on the new recordings than to scale the old ones by the level
of friction, to train all weights than the output layer alone, to keep the learning rate of a training from scratch than
to lower it, and to train without dropout.
"""

from collections.abc import Sequence

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.realtime.bounds import causal_velocity, standstill_below_m_s
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.columns import LOAD_FORCE, OIL_TEMPERATURE, OTHER_POSITIONS, POSITION
from cylinder_friction.recordings.recording import Recording, RecordingError

ADAPTATION_PLAN = TrainingPlan(epochs=20, patience=None)
LEAST_SLIDING_S = 3.0
"""Least time of sliding in usable rows, in each direction [s]."""
SLIDING_M_S, SLIDING_DEVIATIONS = 5e-4, 3.0
"""The piston slides if it is faster than this, and faster than this multiple of the velocity's noise."""


def adaptation_inputs(
    inputs: Sequence[str], recordings: Sequence[Recording], load: PositionLoad | None
) -> tuple[str, ...]:
    """Choose the inputs of an adapted hybrid: those of the old one, with the new cylinder's load in place of the old.

    The oil temperature is left out if the recordings lack it.
    """
    columns = set.intersection(*(set(recording.columns) for recording in recordings))
    kept = [
        name
        for name in inputs
        if name not in (LOAD_FORCE, *OTHER_POSITIONS) and (name != OIL_TEMPERATURE or name in columns)
    ]
    if load is not None:
        return (*kept, *(name for name in load.columns if name != POSITION))
    return (*kept, LOAD_FORCE) if LOAD_FORCE in columns else tuple(kept)


def feature_places(known: Sequence[str], features: Sequence[str]) -> list[int | None]:
    """Look up each feature's place among the known features, by name; None for a new feature."""
    return [known.index(name) if name in known else None for name in features]


def refuse_few_strokes(recordings: Sequence[Recording]) -> None:
    """Refuse recordings to train on in which the piston does not slide in both directions for long enough.

    Raises:
        RecordingError: It slides for less than ``LEAST_SLIDING_S`` in one direction.
    """
    extending_s, retracting_s = (sum(sliding_s(each, way) for each in recordings) for way in (1.0, -1.0))
    if min(extending_s, retracting_s) < LEAST_SLIDING_S:
        names = ", ".join(dict.fromkeys(recording.name for recording in recordings)) or "none"
        raise RecordingError(
            f"recordings to train on ({names}): the piston slides for {extending_s:.1f} s while extending and "
            f"{retracting_s:.1f} s while retracting, expected at least {LEAST_SLIDING_S:g} s each, also without the "
            "third of the sessions that bounds are calibrated on; record more strokes in both directions, slow and "
            "fast, in several sessions"
        )


def sliding_s(recording: Recording, direction: float) -> float:
    """Measure how long the piston slides in usable rows in a direction (1.0 extends, -1.0 retracts) [s]."""
    slowest_m_s = max(SLIDING_M_S, SLIDING_DEVIATIONS * standstill_below_m_s([recording]))
    slides = direction * causal_velocity(recording) > slowest_m_s
    return float(np.count_nonzero(slides & recording.usable())) * recording.sample_time_s


def left_out_in_words(recordings: Sequence[Recording], estimates_n: Sequence[Array]) -> str:
    """State the mean absolute error, against the label, of estimates [N] by models that did not train on them."""
    errors, labels = [], []
    for recording, estimate_n in zip(recordings, estimates_n, strict=True):
        usable, label_n = recording.usable(), recording.column("friction_n")
        errors.append(np.abs(estimate_n - label_n)[usable])
        labels.append(np.abs(label_n)[usable])
    error_n, label_n = np.concatenate(errors).mean(), np.concatenate(labels).mean()
    return (
        ", each estimated by a model that was not trained on it, with a mean absolute error against the label of "
        f"{error_n:.1f} N ({100.0 * error_n / label_n:.2f} % of mean absolute friction)"
    )


def adapted_in_words(source_hash: str, recordings: Sequence[Recording], bounds_rest_on: str) -> str:
    """State which model was adapted, on how many minutes, and what its bounds rest on (empty: it has no bounds)."""
    minutes = sum(len(recording) * recording.sample_time_s for recording in recordings) / 60.0
    words = f"adapted from the model with SHA-256 {source_hash} on {minutes:.1f} min"
    return f"{words}; its bounds rest on {bounds_rest_on}" if bounds_rest_on else words
