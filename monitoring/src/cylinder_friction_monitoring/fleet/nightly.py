"""Run over a fleet: convert new logs to sessions, assess each cylinder, and draw the page."""

import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import cylinder_friction
from cylinder_friction.files.result_folder import ResultFolder, existing
from cylinder_friction.files.whole_files import hash_of, json_hash, read_json, write_json
from cylinder_friction.recordings.logs import log_paths
from cylinder_friction_monitoring.errors import Refused
from cylinder_friction_monitoring.fleet.assignment import assigned
from cylinder_friction_monitoring.fleet.database import SQLITE_FILE
from cylinder_friction_monitoring.fleet.entries import ENTRIES_FILE, entries_of
from cylinder_friction_monitoring.fleet.files import RESULTS, pane_file, read_or_name, session_file, state_file
from cylinder_friction_monitoring.fleet.one_cylinder import CylinderRun, Known, Taken
from cylinder_friction_monitoring.fleet.plan import Fleet
from cylinder_friction_monitoring.fleet.processes import outcomes
from cylinder_friction_monitoring.page.health_page import write_health_page
from cylinder_friction_monitoring.trends.cylinder_line import CylinderLine, in_order

HEALTH_FILE, PAGE_FILE, ANNOUNCED_FILE = "health.json", "health.html", "announced.json"
WRITTEN_BY = "cylinder-friction monitor"
ANNOUNCED_ANEW = "alarms that were announced before count as new"
ONE_EACH = ("sessions", "cylinders", "panes")
OWN = {HEALTH_FILE, PAGE_FILE, ANNOUNCED_FILE, ENTRIES_FILE, SQLITE_FILE, RESULTS, *ONE_EACH}
"""All files and folders that runs write into the folder of results."""
ALARM, REFUSED = 3, 1  # Exit status of a run with a new alarm, and of a run that refused something


@dataclass(frozen=True)
class FleetHealth:
    """The results of one run."""

    folder: Path
    lines: tuple[CylinderLine, ...]  # One line per cylinder; cylinders that need a person come first
    refused: tuple[Refused, ...]  # Logs, sessions and files that were not used
    news: tuple[str, ...]  # A sentence on each thing that is new
    notes: tuple[str, ...]  # Notes on reading, such as guesses, and on logs that wait for the next run
    new_alarms: tuple[str, ...]  # Cylinders with an alarm that no earlier run has announced

    @property
    def status(self) -> int:
        """Exit status: 3 for a new alarm; otherwise 1 if something was refused, else 0."""
        return ALARM if self.new_alarms else REFUSED if self.refused else 0

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``health.json``."""
        cylinders = [asdict(each) for each in self.lines]
        return {"cylinders": cylinders, "refused": [asdict(each) for each in self.refused], "news": list(self.news)}

    def announced(self) -> None:
        """Record that these alarms have been announced, so that the next run does not call them new."""
        alarms = {each.cylinder: list(each.alarms) for each in self.lines if each.alarms}
        write_json(self.folder / ANNOUNCED_FILE, alarms)


def monitor_fleet(
    logs: Sequence[str | Path],
    fleet: Fleet,
    into: Path,
    now: datetime,
    processes: int = 1,
    waiting: Mapping[str, str] | None = None,
) -> FleetHealth:
    """Process the new logs of a fleet, assess its cylinders, and draw the page.

    A cylinder is assessed if a log, an entry or the fleet file is new. An error in one cylinder does not stop the
    others. The next run completes a run that was killed, and rebuilds damaged files.

    Args:
        logs: Files, folders or patterns. Without any, the sessions of earlier runs are assessed again.
        fleet: The cylinders.
        into: The folder of results, new or from an earlier run.
        now: The present time; a session cannot begin later.
        processes: Number of processes that share the cylinders.
        waiting: By cylinder, why its new logs wait for the next run.

    Raises:
        RecordingError: A log or pattern is missing.
        FileExistsError: The folder of results contains other files, is in the logs, or is being written by another run.
    """
    paths, refused = _logs(logs)
    root = _root(logs)
    beside = {path for each in fleet.cylinders.values() for path in (each.channels, each.model) if path}
    read = existing([*logs, *beside])
    target = ResultFolder(into, HEALTH_FILE, WRITTEN_BY, read)
    refused += _restored_marker(target)
    target.check()
    if not (into / HEALTH_FILE).exists():  # claim the folder, even if the run is killed
        write_json(into / HEALTH_FILE, {"written_by": WRITTEN_BY, "files": [HEALTH_FILE]})
    with target.written() as draft:
        own, nobodys = assigned({path.relative_to(root.parent).as_posix(): path for path in paths}, fleet)
        refused += nobodys
        entries, code = entries_of(into, fleet, refused), code_hash()
        runs = [CylinderRun(name, each, into, root, code, now) for name, each in fleet.cylinders.items()]
        waits = waiting or {}
        refused += [Refused(name, f"its new logs wait for the next run: {why}") for name, why in waits.items()]
        first = [partial(run.taken, () if run.name in waits else own.get(run.name, ()), bool(paths)) for run in runs]
        taken = {
            run.name: one if isinstance(one, Taken) else Taken((run.error("took no log", one),))
            for run, one in zip(runs, outcomes(first, processes), strict=True)
        }
        foreign = copies(taken)
        jobs = [partial(run.known, draft, entries.get(run.name, []), foreign.get(run.name, {})) for run in runs]
        known = {
            run.name: one if isinstance(one, Known) else run.not_assessed(draft, one)
            for run, one in zip(runs, outcomes(jobs, processes), strict=True)
        }
        refused += [each for one in taken.values() for each in one.refused]
        for name, one in known.items():
            refused += one.damaged
            refused += [Refused(f"{name}: {each}", why) for each, why in {**one.failed, **one.left_out}.items()]
        lines = in_order([one.line for one in known.values()])
        news = [each for one in known.values() for each in one.news]
        new_alarms = _not_announced(lines, into, refused)
        notes = [note for one in taken.values() for note in one.notes]
        health = FleetHealth(into, lines, tuple(refused), tuple(news), tuple(notes), tuple(new_alarms))
        before = read_json(into / HEALTH_FILE)
        content = health.to_dict()
        if {name: before.get(name) for name in content} != content | {"news": before.get("news")}:
            write_health_page(draft / PAGE_FILE, lines, refused, news)
            keep = [place(name) for name in _once_known(into) for place in (session_file, state_file, pane_file)]
            write_json(draft / HEALTH_FILE, content | {"kept": keep})
    return health


def code_hash() -> str:
    """Hash the code that makes results: this package and ``cylinder_friction``."""
    return json_hash([hash_of(Path(__file__).parents[1]), hash_of(Path(cylinder_friction.__file__).parent)])


def copies(taken: Mapping[str, Taken]) -> dict[str, dict[str, str]]:
    """Find logs of several cylinders, and state by cylinder and session why they do not count there.

    A log that was moved counts in its new place. A log that two cylinders have at once counts for neither.
    """
    holders = defaultdict(list)
    for name, one in taken.items():
        for digest, (session, here) in one.logs.items():
            holders[digest].append((name, session, here))
    foreign = defaultdict[str, dict[str, str]](dict)
    for held in holders.values():
        present = [name for name, _, is_here in held if is_here]
        for name, session, is_here in held if len(held) > 1 else ():
            others = ", ".join(sorted(other for other, _, _ in held if other != name))
            if len(present) == 1 and not is_here:
                foreign[name][session] = f"its log was moved to {present[0]}, where it counts"
            elif len(present) != 1:
                foreign[name][session] = f"the same log lies with {others}; keep it with the cylinder that it is of"
    return dict(foreign)


def _root(logs: Sequence[str | Path]) -> Path:
    """Return the folder that the given paths share; names of logs are relative to it."""
    folders = []
    for each in logs:
        path = Path(os.path.abspath(each))  # noqa: PTH100 - keeps links
        wild = next((place for place, part in enumerate(path.parts) if set(part) & set("*?[")), len(path.parts) - 1)
        folders.append(path if path.is_dir() else Path(*path.parts[:wild]))
    return Path(os.path.commonpath(folders)) if folders else Path.cwd()


def _once_known(into: Path) -> list[str]:
    """List the cylinders with files of an earlier run, including those that the fleet file no longer names."""
    return sorted(path.stem for path in (into / state_file("any")).parent.glob("*.json"))


def _not_announced(lines: Sequence[CylinderLine], into: Path, damaged: list[Refused]) -> list[str]:
    def read(path: Path) -> dict[str, set[str]]:
        return {name: set(alarms) for name, alarms in read_json(path).items()}

    before = read_or_name(into, ANNOUNCED_FILE, read, dict[str, set[str]](), ANNOUNCED_ANEW, damaged)
    return [each.cylinder for each in lines if set(each.alarms) - before.get(each.cylinder, set())]


def _logs(given: Sequence[str | Path]) -> tuple[list[Path], list[Refused]]:
    """Find the logs; refuse folders without logs, which may be a disk that is not mounted."""
    found, empty = set[Path](), list[Refused]()
    for each in given:
        try:
            found.update(Path(os.path.abspath(path)) for path in log_paths([each]))  # noqa: PTH100 - keeps links
        except ValueError:
            if not Path(each).is_dir():
                raise
            empty.append(Refused(str(each), "is an empty folder, so that no log was read from it; is its disk there?"))
    return sorted(found), empty


def _restored_marker(target: ResultFolder) -> list[Refused]:
    """Claim a folder whose ``health.json`` is damaged, if it holds nothing but files that runs write."""
    folder, damaged = target.folder, list[Refused]()
    read_or_name(folder, HEALTH_FILE, read_json, None, "it was made anew", damaged)
    if damaged and all(path.name in OWN or path.name.startswith(".") for path in folder.iterdir()):
        inside = [path for name in ONE_EACH for path in (folder / name).glob("*")]
        target.claim([PAGE_FILE, *(path.relative_to(folder).as_posix() for path in inside)])
        return damaged
    return []
