"""Which sessions train, validate and test: whole sessions, never rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cylinder_friction.recordings.recording import RecordingError, RecordingMetadata

HELD_OUT = "held_out_sessions"
LEAVE_LOAD = "leave_one_load_out"
LEAVE_TEMPERATURE = "leave_one_temperature_out"
UNSEEN_RIG = "unseen_rig"
TEMPERATURES = ("cold", "medium", "warm")


@dataclass(frozen=True)
class Fold:
    """Names of recordings by role; a session has one role."""

    split: str
    left_out: str  # Which load or temperature; empty where nothing is left out
    train: tuple[str, ...]  # Names are sorted
    validation: tuple[str, ...]  # Calibrates bounds, and chooses while tuning
    test: tuple[str, ...]


def held_out(roles: Mapping[str, tuple[str, ...]]) -> Fold:
    """Return the fold that other folds are made from, from names by role as ``split_sessions`` gives them."""
    return Fold(HELD_OUT, "", roles["train"], roles["validation"], roles["test"])


def leave_one_load_out(base: Fold, metadata: Sequence[RecordingMetadata]) -> tuple[Fold, ...]:
    """Return one fold per condition (load); all its sessions are tested, none of them trains or validates."""
    return _leave_out(base, {entry.name: entry.condition for entry in metadata}, LEAVE_LOAD)


def leave_one_temperature_out(
    base: Fold, metadata: Sequence[RecordingMetadata], mean_temperature_c: Mapping[str, float]
) -> tuple[Fold, ...]:
    """Return three folds: the third of all sessions with the coldest oil is tested, the middle, and the warmest."""
    sessions: dict[str, list[float]] = {}
    for entry in metadata:
        sessions.setdefault(entry.session, []).append(mean_temperature_c[entry.name])
    means = {session: sum(values) / len(values) for session, values in sessions.items()}
    ordered = sorted(means, key=lambda session: (means[session], session))
    group = {session: TEMPERATURES[place * 3 // len(ordered)] for place, session in enumerate(ordered)}
    return _leave_out(base, {entry.name: group[entry.session] for entry in metadata}, LEAVE_TEMPERATURE)


def unseen_rig(base: Fold, metadata: Sequence[RecordingMetadata]) -> Fold:
    """Return the fold that trains as ``base`` does and tests on all recordings of another rig's campaign."""
    return Fold(UNSEEN_RIG, "", base.train, base.validation, tuple(sorted(entry.name for entry in metadata)))


def refuse_leaks(fold: Fold, metadata: Sequence[RecordingMetadata]) -> None:
    """Refuse a fold with an empty role, or a session in two; a test on an unseen rig has other sessions."""
    session = {entry.name: entry.session for entry in metadata}
    roles = {"train": fold.train, "validation": fold.validation}
    if fold.split != UNSEEN_RIG:
        roles["test"] = fold.test
    where = f"split {fold.split} {fold.left_out!r}"
    seen: dict[str, str] = {}
    for role, names in roles.items():
        if not names:
            raise RecordingError(
                f"{where}: no recording has the role {role}; expected at least one; record more sessions per condition"
            )
        for name in names:
            before = seen.setdefault(session[name], role)
            if before != role:
                raise RecordingError(
                    f"{where}: session {session[name]!r} is in {before} and in {role} (recording {name!r}); expected "
                    "one role per session"
                )


def _leave_out(base: Fold, groups: Mapping[str, str], split: str) -> tuple[Fold, ...]:
    folds = []
    for group in sorted(set(groups.values())):
        inside = {name for name, member in groups.items() if member == group}
        train = tuple(name for name in base.train if name not in inside)
        validation = tuple(name for name in base.validation if name not in inside)
        folds.append(Fold(split, group, train, validation, tuple(sorted(inside))))
    return tuple(folds)
