"""The offset of the sensors' zeros in each session of a campaign, subtracted from the labels of every role."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.known_offset import cautious, of_condition, training_models, without_offsets
from cylinder_friction.labelling.offset_tracker import fit_offset_tracker, zeros_are_known
from cylinder_friction.labelling.sliding_blocks import LOADED, OffsetPlan, zero_uncertainty_n
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.recordings.columns import PRESSURE_1
from cylinder_friction.recordings.recording import Recording


@dataclass(frozen=True)
class Corrected:
    """Recordings by role without their sensors' offsets, and the identified offsets."""

    recordings: Mapping[str, Sequence[Recording]]
    sessions: list[dict[str, Any]]  # Role, condition and offset of each session
    tracker: OffsetTracker | None  # Tracker by which an estimator learns the offset; None if it cannot
    left_alone_because: str = ""  # Reason why no offsets were identified; empty if they were


def take_offsets(
    recordings: Mapping[str, Sequence[Recording]],
    cylinder: Cylinder,
    plan: OffsetPlan,
    channels: tuple[str, ...],
    identify: Literal["auto", "always", "never"],
    own_loads: bool,
) -> Corrected:
    """Subtract the offset of each session from its labels, if strokes show it.

    The training sessions alone determine friction; every other session is identified by itself. Estimators learn the
    offset from their inputs, ``channels``. ``auto`` subtracts only offsets that strokes show, ``always`` all, ``never``
    none. With ``own_loads``, each session has a load of its own, which hides the offset.

    Raises:
        RecordingError: ``identify`` is ``always``, but offsets cannot be identified.
    """
    always = identify == "always"
    reason = "" if always else _left_alone(recordings, cylinder, identify, own_loads)
    if not reason:
        models, reason = training_models(recordings["train"], cylinder, plan, always=always)
    if reason:
        return Corrected(recordings, [], None, reason)
    sessions = []
    for condition, model in models.items():
        for role, every in recordings.items():
            own = of_condition(every, condition)
            conditions = {each.metadata.session: each.metadata.condition for each in own}
            for name, found in model.offsets(own).items():
                found = replace(found, standard_uncertainty_n=found.whole_uncertainty_n)
                sessions.append({"role": role, "condition": conditions[name], **asdict(found)})
    corrected = {role: without_offsets(every, models) for role, every in recordings.items()}
    plan = cautious(plan, {each.metadata.session for each in recordings["train"]})
    learnable = PRESSURE_1 in corrected["train"][0].columns and zeros_are_known(corrected["train"])
    tracker = fit_offset_tracker(corrected["train"], cylinder, channels, plan) if learnable else None
    return Corrected(corrected, sessions, tracker)


def _left_alone(recordings: Mapping[str, Sequence[Recording]], cylinder: Cylinder, wanted: str, own_loads: bool) -> str:
    """Explain why offsets are not identified; empty if they are."""
    if wanted == "never":
        return "offset.identify is never"
    if own_loads:
        return LOADED["position"]
    every = [recording for own in recordings.values() for recording in own]
    unknown = [recording.name for recording in every if zero_uncertainty_n(recording, cylinder) is None]
    return f"the uncertainty of the sensors' zeros is not stated ({unknown[0]})" if unknown else ""
