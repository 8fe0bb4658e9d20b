"""What people did and stated about a fleet: entries with a time and a name, added to a file and never changed.

An entry is withdrawn by a later one, which names its kind and time.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path
from typing import get_args

from cylinder_friction.files.locks import locked
from cylinder_friction.files.whole_files import write_text
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.fleet.plan import Fleet
from cylinder_friction_monitoring.trends.assessment import Entry, EntryKind
from cylinder_friction_monitoring.trends.in_force import NEAR_D, NEW_BASELINE
from cylinder_friction_monitoring.trends.moments import moment, utc_time

ENTRIES_FILE = "entries.jsonl"  # One entry per line, in the order in which they were added
FLEET_FILE = "fleet.yaml"  # The name on entries that come from it


def add_entry(folder: Path, entry: Entry, fleet: Fleet) -> None:
    """Add one entry to the file of a folder of results; a kill adds it whole or not at all.

    An entry that withdraws another names it by its kind and time, or the first part of its time.

    Raises:
        MonitoringError: Its cylinder or kind is unknown, it has no name, its time is none, or what it withdraws is not
            one entry.
    """
    if entry.cylinder not in fleet.cylinders:
        raise MonitoringError(f"entry: unknown cylinder {entry.cylinder!r}; {_known(fleet)}")
    if entry.kind not in get_args(EntryKind):
        raise MonitoringError(f"entry: got the kind {entry.kind!r}, expected one of {', '.join(get_args(EntryKind))}")
    if not entry.name.strip():
        raise MonitoringError("entry: no name; state who makes it, with --name")
    if entry.until and entry.kind != "acknowledge":
        raise MonitoringError(f"entry: --until belongs to acknowledge, but got {entry.kind}")
    try:
        utc_time(entry.time, "entry: time")
        until = entry.until and utc_time(entry.until, "entry: until")
    except ValueError as error:
        raise MonitoringError(str(error)) from None
    path = folder / ENTRIES_FILE
    with locked(folder / ".entries.lock"):
        withdraws = _withdrawn_by(entry, entries_of(folder, fleet)[entry.cylinder])
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        stated = asdict(replace(entry, until=until, withdraws=withdraws))
        kept = {name: value for name, value in stated.items() if value or name == "words"}
        write_text(path, f"{text}{json.dumps(kept, sort_keys=True, ensure_ascii=False)}\n")


def refuse_far(entry: Entry, starts: Sequence[str], now: datetime) -> None:
    """Refuse an entry whose time is far from all sessions of its cylinder, or has not come.

    An acknowledgement, comment or withdrawal after the newest session is not far. ``starts`` are of the sessions.

    Raises:
        MonitoringError: The time is probably mistyped.
    """
    time = moment(utc_time(entry.time, "entry: time"))
    times = [moment(start) for start in starts]
    nearest = min(times, key=lambda each: abs(each - time), default=None)
    where = ""
    if time > now:
        where = "has not come"
    elif nearest is not None and abs(nearest - time).total_seconds() > 86400.0 * NEAR_D:
        days = abs(nearest - time).days
        where = f"is {days} days {'after' if time > nearest else 'before'} the nearest session, of {nearest:%Y-%m-%d}"
        where = "" if time > max(times) and entry.kind not in NEW_BASELINE else where
    if where:
        raise MonitoringError(
            f"entry: time: {entry.time} {where}; state when it was with --time, or add --confirm if the time is right"
        )


def entries_of(folder: Path, fleet: Fleet) -> dict[str, list[Entry]]:
    """Return each cylinder's entries by time; services that the fleet file states are among them.

    Raises:
        MonitoringError: A line of the file is no entry.
    """
    entries: dict[str, list[Entry]] = {
        name: [
            Entry(name, utc_time(service.time, "time"), FLEET_FILE, "service", service.words)
            for service in cylinder.services
        ]
        for name, cylinder in fleet.cylinders.items()
    }
    path = folder / ENTRIES_FILE
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines() if path.is_file() else (), start=1):
        try:
            entry = Entry(**json.loads(line))
            time = utc_time(entry.time, "time")
        except (ValueError, TypeError) as error:
            raise MonitoringError(
                f"{path}, line {number}: is no entry ({error}); restore the line, entries are added with --entry"
            ) from None
        entries.setdefault(entry.cylinder, []).append(replace(entry, time=time))
    return {name: sorted(_without_withdrawn(own), key=lambda each: each.time) for name, own in entries.items()}


def _without_withdrawn(entries: Sequence[Entry]) -> list[Entry]:
    """Return entries in the order in which they were added, with who withdrew them: a later one, itself in force."""
    found = list(entries)
    for place in reversed(range(len(found))):
        entry = found[place]
        if entry.withdraws and not entry.withdrawn:
            by = f"{entry.name}: {entry.words}"
            same = [each for each in range(place) if f"{found[each].kind} {found[each].time}" == entry.withdraws]
            found = [replace(each, withdrawn=by) if at in same else each for at, each in enumerate(found)]
    return found


def _withdrawn_by(entry: Entry, entries: Sequence[Entry]) -> str:
    """Return kind and time of the entry that another withdraws; empty if it withdraws none."""
    if entry.kind != "withdraw":
        if entry.withdraws:
            raise MonitoringError(f"entry: --of belongs to withdraw, but got {entry.kind}")
        return ""
    if not entry.words.strip():
        raise MonitoringError("entry: no reason; state why the entry is withdrawn, with --words")
    kind, _, time = entry.withdraws.removesuffix("Z").partition(" ")
    there = [each for each in entries if not each.withdrawn]
    own = {f"{each.kind} {each.time}" for each in there if each.kind == kind and time and each.time.startswith(time)}
    if len(own) == 1:
        return own.pop()
    known = ", ".join(f"{each.kind} {each.time}" for each in there) or "none"
    raise MonitoringError(
        f"entry: --of {entry.withdraws or 'is missing'}: expected the kind and time of one entry of {entry.cylinder}, "
        f"of which these are in force: {known}"
    )


def _known(fleet: Fleet) -> str:
    names = list(fleet.cylinders)
    return f"expected one of {', '.join(names[:10])}{', ...' if len(names) > 10 else ''}"
