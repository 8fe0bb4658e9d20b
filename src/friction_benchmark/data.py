"""What the benchmark is run on: simulated campaigns, one of each kind a seed, or recordings of one's own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from cylinder_friction.recordings.files import whole_folder
from cylinder_friction.recordings.splits import split_sessions
from cylinder_friction.recordings.storage import read_recordings, write_recording
from cylinder_friction.rig.campaign import CampaignPlan
from friction_benchmark.campaigns import labelled_campaign
from friction_benchmark.folds import (
    HELD_OUT,
    LEAVE_LOAD,
    LEAVE_TEMPERATURE,
    Fold,
    held_out,
    leave_one_load_out,
    leave_one_temperature_out,
    refuse_leaks,
    unseen_rig,
)
from friction_benchmark.tasks import SENSOR_DRAWS, TEMPERATURE, Exam, exam_of, of_the_present
from friction_benchmark.twin import TwinPlan, teaching_recordings

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.evaluation.bootstrap import Array
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.tasks import Task

Kind = Literal["campaign", "loaded", "unseen", "unseen_loaded", "twin", "twin_loaded"]

UNSEEN_SEEDS = 1000
"""Seeds of unseen rigs begin here, so that none of them is a rig that taught."""
TRUE_FRICTION, TRUE_LOAD = "true_friction_n", "true_load_n"


@dataclass(frozen=True, eq=False)
class Case:
    """A labelled recording and, where somebody knows them, true friction and true load [N], shape ``(n,)``."""

    recording: Recording
    true_friction_n: Array | None
    true_load_n: Array | None


@dataclass(frozen=True)
class Sizes:
    """How much is simulated.

    Attributes:
        sessions_per_condition: In each of the four tests.
        recordings_per_session: Of each session.
        duration_s: Of a recording [s].
        test_sessions: Of each test, held out.
        validation_sessions: Of each test; they choose while tuning and calibrate bounds.
        unseen_sessions: Of each test on the unseen rig.
        twin_rigs: Rigs of the simulated twin, whose true friction teaches; two recordings of each test on each.
    """

    sessions_per_condition: int
    recordings_per_session: int
    duration_s: float
    test_sessions: int
    validation_sessions: int
    unseen_sessions: int
    twin_rigs: int


@dataclass(frozen=True)
class Sources:
    """Where the recordings lie; small, so that every worker can be told.

    Attributes:
        folder: Of the simulated campaigns.
        sizes: Of the simulated campaigns.
        own: Role (train, validation, test) and folder, where one's own recordings are used; empty otherwise.
    """

    folder: Path
    sizes: Sizes
    own: tuple[tuple[str, Path], ...] = ()

    @property
    def simulated(self) -> bool:
        return not self.own


def simulate_campaign(sources: Sources, cylinder: Cylinder, kind: Kind, seed: int) -> None:
    """Simulate one campaign, or the twin's lessons, and stores them, unless they are there already."""
    folder = _folder(sources, kind, seed)
    if folder.is_dir():
        return
    sizes = sources.sizes
    load: Literal["none", "varied"] = "varied" if kind.endswith("loaded") else "none"
    if kind.startswith("twin"):
        made = teaching_recordings(TwinPlan(seed, sizes.twin_rigs, sizes.duration_s, load), cylinder)
    else:
        made = labelled_campaign(campaign_plan(sizes, kind, seed), cylinder)
    with whole_folder(folder) as draft:
        for labelled in made:
            known = {TRUE_FRICTION: labelled.true_friction_n, TRUE_LOAD: labelled.true_load_n}
            write_recording(draft, labelled.recording.with_columns(**known))


def campaign_plan(sizes: Sizes, kind: Kind, seed: int) -> CampaignPlan:
    """Return what is simulated; an unseen rig is any rig of this size, another one for every seed."""
    elsewhere = kind.startswith("unseen")
    return CampaignPlan(
        seed=UNSEEN_SEEDS + seed if elsewhere else seed,
        sessions_per_condition=sizes.unseen_sessions if elsewhere else sizes.sessions_per_condition,
        recordings_per_session=sizes.recordings_per_session,
        duration_s=sizes.duration_s,
        external_load="varied" if kind.endswith("loaded") else "none",
        specimen="wide" if elsewhere else "default",
    )


def cases_of(sources: Sources, kind: Kind, seed: int) -> dict[str, Case]:
    """Return recordings by name; one's own are the same for every seed, and nobody knows their truth."""
    if sources.own and not kind.startswith("twin"):
        return _read(tuple(folder for _, folder in sources.own))
    return _read((_folder(sources, kind, seed),))


def folds_of(sources: Sources, task: Task, split: str, seed: int) -> tuple[Fold, ...]:
    """Return the folds of a split, checked for leaks; who chooses and who is asked is so with every pair of sensors.

    Raises:
        RecordingError: There are too few sessions, or a session would have two roles.
    """
    cases = cases_of(sources, task.campaign, seed)
    metadata = [case.recording.metadata for case in cases.values()]
    base = held_out(_roles(sources, task, seed))
    if split == HELD_OUT:
        folds: tuple[Fold, ...] = (base,)
    elif split == LEAVE_LOAD:
        folds = leave_one_load_out(base, metadata)
    elif split == LEAVE_TEMPERATURE:
        means = {name: float(case.recording.column(TEMPERATURE).mean()) for name, case in cases.items()}
        folds = leave_one_temperature_out(base, metadata, means)
    else:
        others = cases_of(sources, unseen_kind(task), seed)
        folds = (unseen_rig(base, [case.recording.metadata for case in others.values()]),)
    for fold in folds:
        refuse_leaks(fold, metadata)
    return tuple(
        replace(fold, validation=_all_drawn(task, fold.validation), test=_all_drawn(task, fold.test)) for fold in folds
    )


def unseen_kind(task: Task) -> Kind:
    return "unseen" if task.campaign == "campaign" else "unseen_loaded"


@lru_cache(maxsize=6)
def exams_of(sources: Sources, task: Task, kind: Kind, seed: int) -> dict[str, Exam]:
    """Return the recordings of a campaign as the task puts them, by name; where sensors drift, several of each."""
    return {
        drawn: exam_of(task, case, seed, draw)
        for name, case in cases_of(sources, kind, seed).items()
        for draw, drawn in enumerate(_drawn(task, name))
    }


def lessons_of(sources: Sources, task: Task, seed: int, *, of_now: bool) -> dict[str, Exam]:
    """Return what teaches: the task's campaign; ``of_now`` makes friction now the target, not friction ahead."""
    return exams_of(sources, of_the_present(task) if of_now else task, task.campaign, seed)


@lru_cache(maxsize=2)
def twin_lessons_of(sources: Sources, task: Task, seed: int) -> tuple[Recording, ...]:
    """Return the task's recordings on the twin's rigs; their target is true friction, which nobody could label."""
    cases = cases_of(sources, twin_kind(task), seed)
    return tuple(exam_of(task, case, seed).recording for case in cases.values())


def _drawn(task: Task, name: str) -> list[str]:
    """Return the names of a recording's exams: its own first, then those with other sensors."""
    return [name, *(f"{name} sensors {draw}" for draw in range(1, SENSOR_DRAWS if task.drifts else 1))]


def _all_drawn(task: Task, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(drawn for name in names for drawn in _drawn(task, name))


def twin_kind(task: Task) -> Kind:
    return "twin" if task.campaign == "campaign" else "twin_loaded"


def _roles(sources: Sources, task: Task, seed: int) -> dict[str, tuple[str, ...]]:
    if sources.own:
        return {role: tuple(sorted(_read((folder,)))) for role, folder in sources.own}
    metadata = [case.recording.metadata for case in cases_of(sources, task.campaign, seed).values()]
    return split_sessions(metadata, sources.sizes.test_sessions, sources.sizes.validation_sessions, seed)


def _folder(sources: Sources, kind: Kind, seed: int) -> Path:
    return sources.folder / f"{kind}-{seed}"


@lru_cache(maxsize=8)
def _read(folders: tuple[Path, ...]) -> dict[str, Case]:
    found: dict[str, Case] = {}
    for folder in folders:
        for recording in read_recordings(folder):
            known = [
                recording.column(name) if name in recording.table.columns else None
                for name in (TRUE_FRICTION, TRUE_LOAD)
            ]
            bare = recording.without_columns(TRUE_FRICTION, TRUE_LOAD)
            found[recording.name] = Case(bare, known[0], known[1])
    return dict(sorted(found.items()))
