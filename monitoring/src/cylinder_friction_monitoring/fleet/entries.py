"""Entries on what people did to a fleet or stated about it. An entry never changes, but a later one may withdraw it."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import get_args

from cylinder_friction.files.whole_files import locked, write_text
from cylinder_friction_monitoring.errors import MonitoringError, Refused
from cylinder_friction_monitoring.fleet.plan import Fleet
from cylinder_friction_monitoring.trends.assessment import Entry, EntryKind
from cylinder_friction_monitoring.trends.moments import utc_time

ENTRIES_FILE = "entries.jsonl"  # One entry per line, in the order in which they were added
FLEET_FILE = "fleet.yaml"  # The name (author) of entries from the fleet file


def add_entry(folder: Path, entry: Entry, fleet: Fleet) -> None:
    """Add an entry to the file in a folder of results.

    A withdrawal names another entry by its kind and its time, or the first part of its time. A wrong cylinder, kind,
    name or time raises ``MonitoringError``, as does a withdrawal that matches no entry or several.
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


def entries_of(folder: Path, fleet: Fleet, damaged: list[Refused] | None = None) -> dict[str, list[Entry]]:
    """Read each cylinder's entries, and its services from the fleet file, in the order of time.

    Damaged lines are added to ``damaged``; without that list, they raise ``MonitoringError``.
    """
    entries = dict[str, list[Entry]]()
    for name, cylinder in fleet.cylinders.items():
        days = [(utc_time(each.time, "time"), each.words) for each in cylinder.services]
        entries[name] = [Entry(name, time, FLEET_FILE, "service", words) for time, words in days]
    path = folder / ENTRIES_FILE
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else ()
    for number, line in enumerate(lines, start=1):
        try:
            entry = Entry(**json.loads(line))
            entries.setdefault(entry.cylinder, []).append(replace(entry, time=utc_time(entry.time, "time")))
        except (ValueError, TypeError, AttributeError) as error:
            why = f"is no entry ({error}), and does not count; restore the line, entries are added with --entry"
            if damaged is None:
                raise MonitoringError(f"{path}, line {number}: {why}") from None
            damaged.append(Refused(f"{ENTRIES_FILE}, line {number}", why))
    return {name: sorted(_without_withdrawn(own), key=lambda each: each.time) for name, own in entries.items()}


def _without_withdrawn(entries: Sequence[Entry]) -> list[Entry]:
    """Mark entries that a later entry withdraws, unless the later entry is withdrawn itself."""
    found = list(entries)
    for place in reversed(range(len(found))):
        entry = found[place]
        if entry.withdraws and not entry.withdrawn:
            by = f"{entry.name}: {entry.words}"
            same = [each for each in range(place) if f"{found[each].kind} {found[each].time}" == entry.withdraws]
            found = [replace(each, withdrawn=by) if at in same else each for at, each in enumerate(found)]
    return found


def _withdrawn_by(entry: Entry, entries: Sequence[Entry]) -> str:
    """Return kind and time of the entry that ``entry`` withdraws; empty if it is no withdrawal."""
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
