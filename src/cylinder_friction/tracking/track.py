"""Log runs from files: ``track`` fills any store from the files that the pipeline wrote."""

from dataclasses import dataclass
from pathlib import Path

from cylinder_friction.files.whole_files import read_json
from cylinder_friction.run_record import RUNS_FOLDER, STAGES, RunRecord
from cylinder_friction.tracking.gate import Registered
from cylinder_friction.tracking.log_run import find_run, log_in
from cylinder_friction.tracking.registry import REGISTERED_FILE, recorded_version
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import open_store


@dataclass(frozen=True)
class Tracked:
    """Result of ``track``."""

    logged: tuple[str, ...]  # Stages whose run was logged now
    present: tuple[str, ...]  # Stages whose run already existed
    problems: tuple[str, ...]  # Descriptions of records that could not be logged
    version: str | None  # Description of the registered version; None if the pipeline has registered none

    def summary(self) -> str:
        lines = [f"{len(self.logged)} runs logged, {len(self.present)} already there"]
        lines += [f"registered model: {self.version}"] if self.version else ["no model is registered yet"]
        return "\n".join([*lines, *(f"not logged: {problem}" for problem in self.problems)])


def track(root: Path) -> Tracked:
    """Log every ``reports/runs/<stage>.json`` that the store lacks.

    The run of ``register`` comes with its version, but never with the champion's alias: only ``register``, ``promote``
    and ``rollback`` move the alias. A version that a person deleted is not made again while that run exists.

    Raises:
        TrackingError: The store cannot be reached, or there is nothing to log.
    """
    paths = {path.stem: path for path in (root / RUNS_FOLDER).glob("*.json")}
    if not paths:
        raise TrackingError(f"{root / RUNS_FOLDER}: holds no run; run `dvc pull` or `dvc repro` first")
    logged: list[str] = []
    present: list[str] = []
    problems: list[str] = []
    version: str | None = None
    with open_store(root) as store:
        for stage in (each for each in (*STAGES, *sorted({*paths} - {*STAGES})) if each in paths):
            try:
                record = RunRecord.from_dict(read_json(paths[stage]))
                known = find_run(store, record) is not None
                if stage == "register" and (root / REGISTERED_FILE).is_file():
                    registered = Registered.from_dict(read_json(root / REGISTERED_FILE))
                    version = recorded_version(store, registered, root, make=not known)
                log_in(store, record, root)
                (present if known else logged).append(stage)
            except (RuntimeError, ValueError, TypeError, AttributeError, OSError) as error:  # missing or cut-off file
                problems.append(f"{stage}.json: {error}")
    return Tracked(tuple(logged), tuple(present), tuple(problems), version)
