"""One run over a fleet: new logs become sessions, sessions are assessed, and a page and tables state what is known."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import cylinder_friction
from cylinder_friction.files.whole_files import hash_of, json_hash, read_json, write_json
from cylinder_friction.recordings.reading_logs import log_paths
from cylinder_friction.recordings.result_folder import ResultFolder, existing
from cylinder_friction_monitoring.errors import Refused
from cylinder_friction_monitoring.fleet.assignment import assigned
from cylinder_friction_monitoring.fleet.entries import entries_of
from cylinder_friction_monitoring.fleet.files import pane_file, session_file, state_file
from cylinder_friction_monitoring.fleet.one_cylinder import CylinderRun, Taken
from cylinder_friction_monitoring.fleet.plan import Fleet
from cylinder_friction_monitoring.fleet.processes import done_in_order
from cylinder_friction_monitoring.page.health_page import write_health_page
from cylinder_friction_monitoring.trends.cylinder_line import CylinderLine, in_order

HEALTH_FILE, PAGE_FILE, ANNOUNCED_FILE = "health.json", "health.html", "announced.json"
WRITTEN_BY = "cylinder-friction monitor"
ALARM, REFUSED = 3, 1
"""Exit status of a run with a new alarm, and of one in which something was refused."""


@dataclass(frozen=True)
class FleetHealth:
    """What one run found."""

    folder: Path
    lines: tuple[CylinderLine, ...]  # Of all cylinders, first what needs a person
    refused: tuple[Refused, ...]  # Logs that were not taken, and sessions that are not assessed
    news: tuple[str, ...]  # One sentence each on what is new
    notes: tuple[str, ...]  # Of reading, such as guesses
    new_alarms: tuple[str, ...]  # Cylinders with an alarm that no run before has announced

    @property
    def status(self) -> int:
        """Exit status: 3 if an alarm is new, whatever else; 1 if something was refused; else 0."""
        return ALARM if self.new_alarms else REFUSED if self.refused else 0

    def to_dict(self) -> dict[str, Any]:
        """Return what the folder's JSON holds, as JSON-compatible values."""
        cylinders = [asdict(each) for each in self.lines]
        return {"cylinders": cylinders, "refused": [asdict(each) for each in self.refused], "news": list(self.news)}

    def announced(self) -> None:
        """Note that the alarms of this run have been announced: the next run does not call them new."""
        alarms = {each.cylinder: list(each.alarms) for each in self.lines if each.alarms}
        write_json(self.folder / ANNOUNCED_FILE, alarms)


def monitor_fleet(
    logs: Sequence[str | Path], fleet: Fleet, into: Path, now: datetime, processes: int = 1
) -> FleetHealth:
    """Take the new logs of a fleet into a folder of results, assess its cylinders, and draw the page.

    Only new logs are processed, and only cylinders of which something is new are assessed: a log, an entry, or what the
    fleet file states. A run that is killed leaves everything as it was, or is finished by the next one.

    Args:
        logs: Files, folders or patterns; none: assess again what is kept.
        fleet: Its cylinders.
        into: A new folder, or one that an earlier run wrote.
        now: No session begins later.
        processes: How many work on cylinders side by side.

    Raises:
        MonitoringError: No log is found, or a file that is kept is damaged.
        FileExistsError: The folder holds something else, lies in what is read, or another run is writing it.
    """
    paths = [Path(os.path.abspath(path)) for path in log_paths(list(logs))] if logs else []  # noqa: PTH100 - keeps links
    root = _root(logs)
    beside = {path for each in fleet.cylinders.values() for path in (each.channels, each.model) if path}
    read = existing([*logs, *beside])
    target = ResultFolder(into, HEALTH_FILE, WRITTEN_BY, read)
    target.check()
    if not (into / HEALTH_FILE).exists():  # from here on the folder is ours, whenever the run ends
        write_json(into / HEALTH_FILE, {"written_by": WRITTEN_BY, "files": [HEALTH_FILE]})
    with target.written() as draft:
        own, refused = assigned({path.relative_to(root.parent).as_posix(): path for path in paths}, fleet)
        entries, code = entries_of(into, fleet), code_hash()
        runs = [CylinderRun(name, each, into, root, code, now) for name, each in fleet.cylinders.items()]
        first = [partial(run.taken, own.get(run.name, ()), bool(paths)) for run in runs]
        taken = dict(zip(fleet.cylinders, done_in_order(first, processes), strict=True))
        foreign = copies(taken)
        jobs = [partial(run.known, draft, entries.get(run.name, []), foreign.get(run.name, {})) for run in runs]
        known = dict(zip(fleet.cylinders, done_in_order(jobs, processes), strict=True))
        refused += [each for one in taken.values() for each in one.refused]
        for name, one in known.items():
            refused += [Refused(f"{name}: {each}", why) for each, why in {**one.failed, **one.left_out}.items()]
        lines = in_order([one.line for one in known.values()])
        news = [each for one in known.values() for each in one.news]
        health = FleetHealth(
            into,
            lines,
            tuple(refused),
            tuple(news),
            tuple(note for one in taken.values() for note in one.notes),
            tuple(_not_announced(lines, into)),
        )
        before = read_json(into / HEALTH_FILE)
        content = health.to_dict()
        if {name: before.get(name) for name in content} != content | {"news": before.get("news")}:
            write_health_page(draft / PAGE_FILE, lines, refused, news)
            keep = [place(name) for name in _once_known(into) for place in (session_file, state_file, pane_file)]
            write_json(draft / HEALTH_FILE, content | {"kept": keep})
    return health


def code_hash() -> str:
    """Return the SHA-256 of the code that makes results: of this package and of the product."""
    return json_hash([hash_of(Path(__file__).parents[1]), hash_of(Path(cylinder_friction.__file__).parent)])


def copies(taken: Mapping[str, Taken]) -> dict[str, dict[str, str]]:
    """Return, by cylinder and session, why a log that lies with several cylinders is not assessed.

    A log that was moved counts where it lies now. One that lies with two cylinders at once counts for neither.
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
    """Return the folder that names of logs are relative to: what the given folders share, whatever lies in them."""
    folders = []
    for each in logs:
        path = Path(os.path.abspath(each))  # noqa: PTH100 - keeps links
        wild = next((place for place, part in enumerate(path.parts) if set(part) & set("*?[")), len(path.parts) - 1)
        folders.append(path if path.is_dir() else Path(*path.parts[:wild]))
    return Path(os.path.commonpath(folders)) if folders else Path.cwd()


def _once_known(into: Path) -> list[str]:
    """Return the cylinders whose files an earlier run wrote, those that the fleet file no longer lists among them."""
    return sorted(path.stem for path in (into / state_file("any")).parent.glob("*.json"))


def _not_announced(lines: Sequence[CylinderLine], into: Path) -> list[str]:
    path = into / ANNOUNCED_FILE
    before = read_json(path) if path.is_file() else {}
    return [each.cylinder for each in lines if set(each.alarms) - set(before.get(each.cylinder, ()))]
