"""Which sessions are for training, validation and test: whole sessions, in every condition, drawn by a hash."""

import hashlib
from collections import Counter
from collections.abc import Sequence

from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata

ROLES = ("train", "validation", "calibration", "test")


def split_sessions(
    metadata: Sequence[RecordingMetadata],
    test_sessions: int,
    validation_sessions: int,
    seed: int,
    calibration_sessions: int = 0,
    held_out: Sequence[str] = (),
) -> dict[str, tuple[str, ...]]:
    """Assign each recording to a role, by name, sorted; every condition is in every role.

    In each condition sessions are put in the order of a hash of seed, condition and session; the first
    ``test_sessions`` are held out for the comparison, the next ``validation_sessions`` for choosing, the next
    ``calibration_sessions`` for nothing but the width of bounds, the rest is for training. Nothing but these names
    decides, so that another recording of a session moves no other one. Sessions that ``held_out`` names are those for
    the test in their condition, in place of the first ones.

    Raises:
        RecordingError: There is no recording, a name occurs twice, a session spans two conditions, a condition has too
            few sessions, or ``held_out`` names one that is not there.

    Example:
        >>> from cylinder_friction.recordings.splits import split_sessions
        >>> metadata = [recording.metadata for recording in recordings]
        >>> roles = split_sessions(metadata, test_sessions=1, validation_sessions=1, seed=1)
        >>> {role: len(names) for role, names in roles.items()}
        {'train': 4, 'validation': 4, 'calibration': 0, 'test': 4}
    """
    if test_sessions < 1 or validation_sessions < 0 or calibration_sessions < 0:
        raise ValueError(
            f"expected at least 1 test, 0 validation and 0 calibration sessions, but got {test_sessions}, "
            f"{validation_sessions} and {calibration_sessions}"
        )
    others = ["validation"] * validation_sessions + ["calibration"] * calibration_sessions
    roles: dict[str, str] = {}
    by_condition = _sessions_by_condition(metadata)
    if unknown := sorted(set(held_out) - set().union(*by_condition.values())):
        there = ", ".join(sorted(set().union(*by_condition.values())))
        raise RecordingError(f"split.held_out names session {unknown[0]!r}, which is not there; got sessions {there}")
    for condition, names in by_condition.items():
        named = names & set(held_out)
        kept = ["test"] * (len(named) or test_sessions) + others
        if len(names) <= len(kept):
            raise RecordingError(
                f"condition {condition!r} has {len(names)} session{'s' if len(names) != 1 else ''} "
                f"({', '.join(sorted(names))}), but {len(kept) + 1} are needed: {kept.count('test')} for test, "
                f"{validation_sessions} for validation, {calibration_sessions} for calibration and at least 1 for "
                "training; record more sessions, lower split.test_sessions, or make ingest.name_pattern distinguish "
                "sessions"
            )
        hashes = {hashlib.sha256(f"{seed}/{condition}/{name}".encode()).digest(): name for name in names}
        drawn = [hashes[each] for each in sorted(hashes)]
        roles |= zip(sorted(drawn, key=lambda name: name not in named), [*kept, *["train"] * len(names)], strict=False)
    return {role: tuple(sorted(entry.name for entry in metadata if roles[entry.session] == role)) for role in ROLES}


def split(
    recordings: Sequence[Recording], test_sessions: int = 1, seed: int = 1
) -> tuple[list[Recording], list[Recording]]:
    """Divide recordings into those for training and those held out, in the given order; no session is in both.

    Of each condition, ``test_sessions`` are held out, and another seed holds out others; refuses as ``split_sessions``.

    Example:
        >>> train, test = cf.split(labelled)
        >>> sessions = {recording.metadata.session for recording in train}
        >>> any(recording.metadata.session in sessions for recording in test)
        False
    """
    held_out = set(split_sessions([recording.metadata for recording in recordings], test_sessions, 0, seed)["test"])
    train = [recording for recording in recordings if recording.name not in held_out]
    return train, [recording for recording in recordings if recording.name in held_out]


def _sessions_by_condition(metadata: Sequence[RecordingMetadata]) -> dict[str, set[str]]:
    if not metadata:
        raise RecordingError("nothing to split, got no recording; expected at least one session per role and condition")
    twice = [name for name, count in Counter(entry.name for entry in metadata).items() if count > 1]
    if twice:
        raise RecordingError(f"recording {min(twice)!r} occurs twice; expected unique names")
    conditions: dict[str, str] = {}
    sessions: dict[str, set[str]] = {}
    for entry in sorted(metadata, key=lambda entry: entry.name):
        condition = conditions.setdefault(entry.session, entry.condition)
        if condition != entry.condition:
            raise RecordingError(
                f"session {entry.session!r} occurs in condition {condition!r} and in condition {entry.condition!r} "
                f"(recording {entry.name!r}); expected one condition per session; make ingest.name_pattern's session "
                "contain the condition"
            )
        sessions.setdefault(entry.condition, set()).add(entry.session)
    return dict(sorted(sessions.items()))
