"""Which recordings a model does not learn from, because early stopping listens to them: whole sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.recordings.recording import Recording

KEPT_SESSIONS = 2
"""Sessions that each test must still teach with, before one of each is held out."""


def held_out_for_stopping(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Return the recordings that teach, and those that early stopping listens to; both are all where there is one
    session.

    Held out is the last session, by name, of each test, so that every load is listened to: one session of one load
    tells little of the others. Where a test would teach with fewer than ``KEPT_SESSIONS`` others, it is the last
    session alone. No session is on both sides, even if several tests share it.
    """
    sessions: dict[str, set[str]] = {}
    for recording in recordings:
        sessions.setdefault(recording.metadata.condition, set()).add(recording.metadata.session)
    held = {max(names) for names in sessions.values()}
    if any(len(names - held) < KEPT_SESSIONS for names in sessions.values()):
        held = {max(held)}
    train = [recording for recording in recordings if recording.metadata.session not in held]
    validation = [recording for recording in recordings if recording.metadata.session in held]
    return train or validation, validation
