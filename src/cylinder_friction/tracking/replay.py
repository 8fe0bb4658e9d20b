"""Runs again from files: whatever store is in use, ``track`` fills it from what the pipeline wrote."""

import json
from dataclasses import dataclass
from pathlib import Path

from cylinder_friction.run_record import STAGES, RunRecord
from cylinder_friction.tracking.log_run import find_run, log_in
from cylinder_friction.tracking.registry import register_again
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import open_store

RUNS_FOLDER = "reports/runs"


@dataclass(frozen=True)
class Replayed:
    """What a replay did."""

    logged: tuple[str, ...]  # Stages whose run was logged now
    present: tuple[str, ...]  # Stages whose run was there already
    problems: tuple[str, ...]  # What could not be logged, in words
    version: str | None  # Version of the registered model; None where the pipeline has registered none

    def summary(self) -> str:
        lines = [f"{len(self.logged)} runs logged, {len(self.present)} already there"]
        lines += [f"registered model: {self.version}"] if self.version else ["no model is registered yet"]
        return "\n".join([*lines, *(f"not logged: {problem}" for problem in self.problems)])


def replay(root: Path) -> Replayed:
    """Log every ``reports/runs/<stage>.json`` that the store lacks and makes sure the registered model is there.

    Raises:
        TrackingError: The store cannot be reached, or there is nothing to log.
    """
    paths = sorted((root / RUNS_FOLDER).glob("*.json"), key=_place)
    if not paths:
        raise TrackingError(f"{root / RUNS_FOLDER}: holds no run; run `dvc pull` or `dvc repro` first")
    logged: list[str] = []
    present: list[str] = []
    problems: list[str] = []
    with open_store(root) as store:
        for path in paths:
            try:
                record = RunRecord.from_dict(json.loads(path.read_text(encoding="utf-8")))
                (present if find_run(store, record) else logged).append(record.name)
                log_in(store, record, root)
            except (TrackingError, ValueError, TypeError) as error:
                logged = [name for name in logged if name != path.stem]
                problems.append(f"{path.name}: {error}")
    try:
        version = register_again(root)
    except TrackingError as error:
        version = None
        problems.append(str(error))
    return Replayed(tuple(logged), tuple(present), tuple(problems), version)


def _place(path: Path) -> tuple[int, str]:
    return (STAGES.index(path.stem) if path.stem in STAGES else len(STAGES), path.stem)
