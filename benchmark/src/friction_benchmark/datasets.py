"""What the benchmark is run on: simulated campaigns, one of each kind per seed, or labelled recordings of one's own."""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import model_validator

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.params.section import Count, Positive, Section
from cylinder_friction.recordings.columns import OIL_TEMPERATURE
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.splits import split_sessions
from cylinder_friction.recordings.storage import read_stored
from friction_benchmark import folds
from friction_benchmark.cases import EvaluationCase, LabelledRecording, Task, evaluation_case, shown_inputs

Kind = Literal["campaign", "loaded", "unseen", "unseen_loaded", "twin", "twin_loaded"]

TRUE_FRICTION, TRUE_LOAD = "true_friction_n", "true_load_n"


def key_of(content: Any) -> str:
    """Return a short hash of anything that JSON can hold, by which what was made from it is found again."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


class Sizes(Section):
    """How much is simulated."""

    sessions_per_condition: Count  # In each of the four conditions
    recordings_per_session: Count  # Of each session
    duration_s: Positive  # Of a recording [s]
    test_sessions: Count  # Of each condition, held out
    validation_sessions: Count  # Of each condition; they choose while tuning and calibrate bounds
    unseen_sessions: Count  # Of each condition on the unseen rig
    twin_rigs: Count  # Rigs of the simulated twin; two recordings of each condition on each

    @model_validator(mode="after")
    def _some_sessions_train(self) -> Self:
        if self.test_sessions + self.validation_sessions >= self.sessions_per_condition:
            raise ValueError(
                f"sessions_per_condition is {self.sessions_per_condition}, of which test_sessions and "
                "validation_sessions leave none to train on; expected at least one more than both together"
            )
        return self

    def simulated(self, kind: Kind) -> dict[str, float]:
        """Return the sizes that a campaign of this kind depends on."""
        if kind.startswith("twin"):
            return {"rigs": self.twin_rigs, "duration_s": self.duration_s}
        sessions = self.unseen_sessions if kind.startswith("unseen") else self.sessions_per_condition
        return {"sessions": sessions, "recordings": self.recordings_per_session, "duration_s": self.duration_s}


@dataclass(frozen=True)
class Sources:
    """Where the recordings are; small, so that every worker can have it."""

    folder: Path  # Of the simulated campaigns, which are found by what they were made from
    sizes: Sizes  # Of the simulated campaigns
    cylinder: Cylinder  # Of all recordings
    code: str = ""  # Hash of the code that simulates and labels
    own: tuple[tuple[str, Path], ...] = ()  # Role (train, validation, test) and folder of one's own recordings, if used
    own_hashes: tuple[tuple[str, str], ...] = ()  # Role and hash of the content of that folder

    @property
    def simulated(self) -> bool:
        return not self.own

    def key(self, kind: Kind, seed: int) -> str:
        """Return what the recordings of a kind are identified by: for the simulated ones, all they are made from."""
        if self.own and not kind.startswith("twin"):
            return " ".join(digest for _, digest in self.own_hashes)
        return key_of([kind, seed, self.sizes.simulated(kind), self.cylinder.to_dict(), self.code])

    def campaign_folder(self, kind: Kind, seed: int) -> Path:
        return self.folder / f"{kind}-{seed}-{self.key(kind, seed)}"


def unseen_kind(task: Task) -> Kind:
    return "unseen" if task.campaign == "campaign" else "unseen_loaded"


def twin_kind(task: Task) -> Kind:
    return "twin" if task.campaign == "campaign" else "twin_loaded"


def labelled_recordings(sources: Sources, kind: Kind, seed: int) -> dict[str, LabelledRecording]:
    """Return recordings by name; one's own are the same for every seed, and their truth is not known."""
    if sources.own and not kind.startswith("twin"):
        own = {name: labelled for _, folder in sources.own for name, labelled in _read(folder).items()}
        return dict(sorted(own.items()))
    return _read(sources.campaign_folder(kind, seed))


def inputs_of(sources: Sources, task: Task, seed: int) -> tuple[str, ...]:
    """Return what estimators see: the task's inputs without a temperature that was not measured."""
    recording = next(iter(labelled_recordings(sources, task.campaign, seed).values())).recording
    return shown_inputs(task, recording)


@lru_cache(maxsize=64)
def folds_of(sources: Sources, task: Task, split: str, seed: int) -> tuple[folds.Fold, ...]:
    """Return the folds of a split, checked for leaks; validation and test have every pair of sensors."""

    def drawn(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(drawn for name in names for drawn in task.draws(name))

    recordings = {name: each.recording for name, each in labelled_recordings(sources, task.campaign, seed).items()}
    metadata = [recording.metadata for recording in recordings.values()]
    if sources.own:
        base = folds.held_out({role: tuple(_read(folder)) for role, folder in sources.own})
    else:
        sizes = sources.sizes
        base = folds.held_out(split_sessions(metadata, sizes.test_sessions, sizes.validation_sessions, seed))
    found: tuple[folds.Fold, ...] = (base,)
    if split == folds.LEAVE_LOAD:
        found = folds.leave_one_load_out(base, metadata)
    elif split == folds.LEAVE_TEMPERATURE:
        means = {name: float(recording.column(OIL_TEMPERATURE).mean()) for name, recording in recordings.items()}
        found = folds.leave_one_temperature_out(base, metadata, means)
    elif split == folds.UNSEEN_RIG:
        others = labelled_recordings(sources, unseen_kind(task), seed)
        found = (folds.unseen_rig(base, [other.recording.metadata for other in others.values()]),)
    for fold in found:
        folds.refuse_leaks(fold, metadata)
    return tuple(replace(fold, validation=drawn(fold.validation), test=drawn(fold.test)) for fold in found)


@lru_cache(maxsize=6)
def cases_of(sources: Sources, task: Task, kind: Kind, seed: int) -> dict[str, EvaluationCase]:
    """Return a campaign's recordings as the task shows them, by name; where sensors drift, several of each."""
    return {
        drawn: evaluation_case(task, labelled, seed, draw)
        for name, labelled in labelled_recordings(sources, kind, seed).items()
        for draw, drawn in enumerate(task.draws(name))
    }


def training_cases(sources: Sources, task: Task, seed: int, *, of_now: bool) -> dict[str, EvaluationCase]:
    """Return the task's campaign; ``of_now`` makes friction now the target, not friction ahead."""
    return cases_of(sources, replace(task, ahead_s=0.0) if of_now else task, task.campaign, seed)


@lru_cache(maxsize=2)
def twin_recordings(sources: Sources, task: Task, seed: int) -> tuple[Recording, ...]:
    """Return the task's recordings on the twin's rigs; their target is true friction, which cannot be labelled."""
    recordings = labelled_recordings(sources, twin_kind(task), seed)
    return tuple(evaluation_case(task, labelled, seed).recording for labelled in recordings.values())


@lru_cache(maxsize=8)
def _read(folder: Path) -> dict[str, LabelledRecording]:
    """Return the recordings of a folder by name, in the order of their names.

    Identified zeros of the sensors are taken off: models of the literature have no part that learns them.
    """
    found: dict[str, LabelledRecording] = {}
    for recording in read_stored(folder):
        friction_n, load_n = (
            recording.column(name) if name in recording.columns else None for name in (TRUE_FRICTION, TRUE_LOAD)
        )
        bare = recording.zeroed().without_columns(TRUE_FRICTION, TRUE_LOAD)
        found[recording.name] = LabelledRecording(bare, friction_n, load_n)
    return dict(sorted(found.items()))
