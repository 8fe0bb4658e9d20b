"""What people did and stated about a fleet: entries with a time and a name, added to a file and never changed."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import get_args

from cylinder_friction.fleet.plan import Fleet
from cylinder_friction.monitoring.assessment import Entry, EntryKind
from cylinder_friction.monitoring.moments import utc_time
from cylinder_friction.recordings.files import write_text
from cylinder_friction.recordings.locks import locked
from cylinder_friction.recordings.recording import RecordingError

ENTRIES_FILE = "entries.jsonl"  # One entry per line, in the order in which they were added
FLEET_FILE = "fleet.yaml"  # The name on entries that come from it


def add_entry(folder: Path, entry: Entry, fleet: Fleet) -> None:
    """Add one entry to the file of a folder of results; a kill adds it whole or not at all.

    Raises:
        RecordingError: Its cylinder or kind is unknown, it has no name, or its time is none.
    """
    if entry.cylinder not in fleet.cylinders:
        raise RecordingError(f"entry: unknown cylinder {entry.cylinder!r}; {_known(fleet)}")
    if entry.kind not in get_args(EntryKind):
        raise RecordingError(f"entry: got the kind {entry.kind!r}, expected one of {', '.join(get_args(EntryKind))}")
    if not entry.name.strip():
        raise RecordingError("entry: no name; state who makes it, with --name")
    try:
        utc_time(entry.time, "entry: time")
    except ValueError as error:
        raise RecordingError(str(error)) from None
    path = folder / ENTRIES_FILE
    with locked(folder / ".entries.lock"):
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        line = json.dumps(asdict(entry), sort_keys=True, ensure_ascii=False)
        write_text(path, f"{text}{line}\n")


def entries_of(folder: Path, fleet: Fleet) -> dict[str, list[Entry]]:
    """Return each cylinder's entries by time; services that the fleet file states are among them.

    Raises:
        RecordingError: A line of the file is no entry.
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
            raise RecordingError(
                f"{path}, line {number}: is no entry ({error}); restore the line, entries are added with --entry"
            ) from None
        entries.setdefault(entry.cylinder, []).append(Entry(**{**asdict(entry), "time": time}))
    return {name: sorted(own, key=lambda entry: entry.time) for name, own in entries.items()}


def _known(fleet: Fleet) -> str:
    names = list(fleet.cylinders)
    return f"expected one of {', '.join(names[:10])}{', ...' if len(names) > 10 else ''}"
