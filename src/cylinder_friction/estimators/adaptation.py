"""What makes a hybrid for another cylinder from one that exists: its plan, inputs, and what recordings must hold.

Choices were measured on a simulated rig of another structure with ten minutes of recordings, see the guide on a new
cylinder. Features and target standardised on the new recordings were better than those of the old cylinder scaled by
the level of friction; training of all weights was better than that of the output layer alone; the learning rate of a
training from scratch was better than smaller ones; without dropout it was better than with it.
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
"""Of usable rows in each direction [s]."""
SLIDING_M_S, SLIDING_DEVIATIONS = 5e-4, 3.0
"""Faster than this, and than so many times the noise of the velocity, counts as sliding."""


def adaptation_inputs(
    inputs: Sequence[str], recordings: Sequence[Recording], load: PositionLoad | None
) -> tuple[str, ...]:
    """Return the inputs of a hybrid for another cylinder: those that exist, less the old load's, with the new load's.

    An oil temperature that the recordings do not have is left out.
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
    """Return the place of each feature among known ones, by name; None for a new one."""
    return [known.index(name) if name in known else None for name in features]


def refuse_few_strokes(recordings: Sequence[Recording]) -> None:
    """Refuse recordings to train on in which the piston does not slide in both directions for long enough.

    Raises:
        RecordingError: So it is.
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
    """Return how long the piston slides in a direction, 1.0 to extend or -1.0, in usable rows [s]."""
    slowest_m_s = max(SLIDING_M_S, SLIDING_DEVIATIONS * standstill_below_m_s([recording]))
    slides = direction * causal_velocity(recording) > slowest_m_s
    return float(np.count_nonzero(slides & recording.usable())) * recording.sample_time_s


def share_that_holds(corrections_n: Array, wanted_n: Array) -> float:
    """Return by which share of corrections, from 0 to 1, the mean absolute distance from those wanted is smallest."""
    shares = np.linspace(0.0, 1.0, 21)
    return float(shares[np.argmin([np.abs(share * corrections_n - wanted_n).mean() for share in shares])])


def left_out_in_words(recordings: Sequence[Recording], estimates_n: Sequence[Array]) -> str:
    """Return how well models estimate [N] recordings that they were not trained on, against the label."""
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
    """Return which model another was adapted from, on how much, and what its bounds rest on; empty: on nothing."""
    minutes = sum(len(recording) * recording.sample_time_s for recording in recordings) / 60.0
    words = f"adapted from the model with SHA-256 {source_hash} on {minutes:.1f} min"
    return f"{words}; its bounds rest on {bounds_rest_on}" if bounds_rest_on else words
