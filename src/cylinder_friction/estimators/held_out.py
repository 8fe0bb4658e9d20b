"""The recordings held out of training, for early stopping or to calibrate the bounds."""

import itertools
from collections.abc import Sequence

from cylinder_friction.recordings.recording import Recording

KEPT_SESSIONS = 2  # Fewest sessions of each condition that remain for training if one of each is held out
FOLDS = 3


def held_out_for_stopping(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Split recordings into those to train on and those that decide when training stops.

    A single session is on both sides. Otherwise the last session of each condition, by name, is held out, so that every
    load counts: a session of one load says little about other loads. If a condition would be left with fewer than
    ``KEPT_SESSIONS`` others, only the last session of all is held out. No session is on both sides, even if several
    conditions share it.
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
    """Divide recordings into at most ``FOLDS`` groups for cross-validation, and state what a group is.

    A group holds whole sessions, dealt by condition, so that each has some of every condition if there are enough. A
    single session is divided into its recordings, a single recording into stretches; errors then do not show how
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
