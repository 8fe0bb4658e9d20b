"""What is asked, on which seeds, and what given recordings do not allow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylinder_friction.recordings.recording import RecordingError
from friction_benchmark.data import cases_of, folds_of
from friction_benchmark.folds import LEAVE_LOAD, LEAVE_TEMPERATURE, UNSEEN_RIG
from friction_benchmark.tasks import TEMPERATURE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from friction_benchmark.running import Bench
    from friction_benchmark.tasks import Task


@dataclass(frozen=True)
class Programme:
    """What is asked.

    Attributes:
        tasks: Names of tasks, all asked on held-out sessions.
        splits: For each other split the tasks that are asked on it.
        models: Names of participants; empty for all.
    """

    tasks: tuple[str, ...]
    splits: Mapping[str, tuple[str, ...]]
    models: tuple[str, ...] = ()


def problem_of(bench: Bench, task: Task, split: str) -> str:
    """Return why a split cannot be asked; empty where it can."""
    cases = list(cases_of(bench.sources, task.campaign, bench.seeds[0]).values())
    if split == UNSEEN_RIG and not bench.sources.simulated:
        return "there are no recordings of another rig"
    if split == LEAVE_LOAD and len({case.recording.metadata.condition for case in cases}) < 2:
        return "all recordings are of one test"
    if split == LEAVE_TEMPERATURE and any(TEMPERATURE not in case.recording.table.columns for case in cases):
        return "the oil's temperature was not measured"
    try:
        for seed in bench.seeds:
            folds_of(bench.sources, task, split, seed)
    except RecordingError as error:
        return str(error)
    return ""
