"""Which recordings are held out of training: those that stop it, and those that calibrate the bounds."""

import itertools
from collections.abc import Sequence

from cylinder_friction.recordings.recording import Recording

KEPT_SESSIONS = 2  # Sessions of each condition that must be left to train on, before one of each is held out
FOLDS = 3


def held_out_for_stopping(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Return the recordings to train on, and those that early stopping goes by.

    Where there is one session alone, both are all of it.

    Held out is the last session, by name, of each condition, so that every load counts: one session of one load holds
    little about the others. Where a condition would be left with fewer than ``KEPT_SESSIONS`` others, it is the last
    session alone. No session is on both sides, even if several conditions share it.
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


def folds(recordings: Sequence[Recording]) -> tuple[list[list[Recording]], str]:
    """Return recordings in at most ``FOLDS`` groups, each to be estimated by a model of the others, and of what kind.

    Groups hold whole sessions, dealt by condition, so that each group has some of every condition if there are enough.
    Of a single session they hold its recordings, of a single recording stretches of it: errors there do not show how
    sessions differ.
    """
    sessions = {(each.metadata.condition, each.metadata.session) for each in recordings}
    names = list(dict.fromkeys(session for _, session in sorted(sessions)))
    alone = "of the only session, so that they do not hold how sessions differ"
    if len(names) > 1:
        groups = [set(names[start::FOLDS]) for start in range(min(FOLDS, len(names)))]
        return [
            [each for each in recordings if each.metadata.session in own] for own in groups
        ], f"{len(names)} sessions"
    if len(recordings) > 1:
        dealt = [list(recordings[start::FOLDS]) for start in range(min(FOLDS, len(recordings)))]
        return dealt, f"{len(recordings)} recordings {alone}"
    edges = [round(len(each) * part / FOLDS) for each in recordings for part in range(FOLDS + 1)]
    pieces = [[recordings[0].rows(slice(*own))] for own in itertools.pairwise(edges)]
    return pieces, f"{FOLDS} stretches of the only recording {alone}"
