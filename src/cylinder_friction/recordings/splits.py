"""Split recordings for training, validation and test: whole sessions of every condition, drawn by a hash."""

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
    """Assign each recording to a role; return sorted names by role. Every condition is in every role.

    In each condition, sessions are sorted by a hash of seed, condition and session. The first ``test_sessions`` are
    for the test, the next ``validation_sessions`` for validation, the next ``calibration_sessions`` only for the width
    of bounds, and the rest for training. Adding a recording to a session does not move other recordings. Sessions in
    ``held_out`` are the test sessions of their condition, in place of the first ones.

    ``RecordingError`` if there is no recording, a name occurs twice, a session spans two conditions or is missing in
    ``held_out``, or a condition has too few sessions.
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
                "training; record more sessions, lower split.test_sessions, or correct ingest.name_pattern"
            )
        hashes = {hashlib.sha256(f"{seed}/{condition}/{name}".encode()).digest(): name for name in names}
        drawn = [hashes[each] for each in sorted(hashes)]
        roles |= zip(sorted(drawn, key=lambda name: name not in named), [*kept, *["train"] * len(names)], strict=False)
    return {role: tuple(sorted(entry.name for entry in metadata if roles[entry.session] == role)) for role in ROLES}


def split(
    recordings: Sequence[Recording], test_sessions: int = 1, seed: int = 1
) -> tuple[list[Recording], list[Recording]]:
    """Split recordings into training and held-out ones, in the given order; no session is in both.

    ``test_sessions`` of each condition are held out; the seed selects them. Raises as ``split_sessions``.

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
    if twice := [name for name, count in Counter(entry.name for entry in metadata).items() if count > 1]:
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
