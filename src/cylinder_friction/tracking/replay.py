"""Runs again from files: whatever store is in use, ``track`` fills it from what the pipeline wrote."""

from dataclasses import dataclass
from pathlib import Path

from cylinder_friction.recordings.files import read_json
from cylinder_friction.run_record import RUNS_FOLDER, STAGES, RunRecord
from cylinder_friction.tracking.gate import Registered
from cylinder_friction.tracking.log_run import find_run, log_in
from cylinder_friction.tracking.registry import REGISTERED_FILE, recorded_version
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import open_store
from cylinder_friction.tracking.versions import LOCK_FILE, dvc_hash, locked_hashes


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
    """Log every ``reports/runs/<stage>.json`` that the store lacks.

    With the run of ``register`` goes the version that it made, but never the champion's alias: only ``register`` and
    ``rollback`` move it. Where that run is there already, the registry stays as it is.

    Raises:
        TrackingError: The store cannot be reached, or there is nothing to log.
    """
    paths = sorted((root / RUNS_FOLDER).glob("*.json"), key=_place)
    if not paths:
        raise TrackingError(f"{root / RUNS_FOLDER}: holds no run; run `dvc pull` or `dvc repro` first")
    logged: list[str] = []
    present: list[str] = []
    problems: list[str] = []
    version: str | None = None
    lock = root / LOCK_FILE
    locked = locked_hashes(lock.read_bytes().decode(errors="replace")) if lock.is_file() else {}
    with open_store(root) as store:
        for path in paths:
            try:
                _refuse_changed(path, path.relative_to(root).as_posix(), locked)
                record = RunRecord.from_dict(read_json(path))
                if record.name != path.stem:
                    raise TrackingError(f"holds a record of {record.name!r}; remove it")
                known = find_run(store, record) is not None
                if record.name == "register" and (root / REGISTERED_FILE).is_file():
                    _refuse_changed(root / REGISTERED_FILE, REGISTERED_FILE.as_posix(), locked)
                    registered = Registered.from_dict(read_json(root / REGISTERED_FILE))
                    version = recorded_version(store, registered, root, make=not known)
                log_in(store, record, root)
                (present if known else logged).append(record.name)
            except (
                RuntimeError,
                ValueError,
                TypeError,
                AttributeError,
                KeyError,
                OSError,
            ) as error:  # of what lies there
                problems.append(f"{path.name}: {error}")
    return Replayed(tuple(logged), tuple(present), tuple(problems), version)


def _refuse_changed(path: Path, name: str, locked: dict[str, str]) -> None:
    """A project without ``dvc.lock``, or a stage that it does not know yet, has nothing to compare with."""
    if locked.get(name) not in (None, dvc_hash(path)):
        raise TrackingError(
            f"{name} is not what {LOCK_FILE} states; `dvc checkout` brings that back, `dvc repro` makes it anew"
        )


def _place(path: Path) -> tuple[int, str]:
    return (STAGES.index(path.stem) if path.stem in STAGES else len(STAGES), path.stem)
