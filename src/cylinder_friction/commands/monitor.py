"""The command ``monitor``: a fleet's new logs become sessions, trends are tested, a page states what needs a person."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from cylinder_friction.commands._model import model_folder
from cylinder_friction.extras import MissingExtraError
from cylinder_friction.monitoring.assessment import Entry, EntryKind
from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from cylinder_friction.fleet.nightly import FleetHealth
    from cylinder_friction.fleet.plan import Fleet

EXPECTED = (ValueError, OSError)
MANY_CYLINDERS = 8
"""With fewer cylinders other processes do not pay."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    words = "files, folders or patterns, of any supported format; without: assess again what is kept"
    parser.add_argument("logs", nargs="*", metavar="LOGS", help=words)
    words = "folder to write; default: health"
    parser.add_argument("--into", "--output", dest="into", type=Path, default=Path("health"), help=words)
    parser.add_argument("--fleet", type=Path, default=Path("fleet.yaml"), help="the cylinders; default: fleet.yaml")
    words = "processes that work side by side; default: one per core"
    parser.add_argument("--workers", type=int, metavar="N", help=words)
    parser.add_argument("--json", action="store_true", help="print what health.json holds instead of lines")
    words = f"add what somebody did or stated about a cylinder, then assess it; KIND: {', '.join(get_args(EntryKind))}"
    parser.add_argument("--entry", nargs=2, metavar=("CYLINDER", "KIND"), help=words)
    parser.add_argument("--name", default="", help="who makes the entry")
    parser.add_argument("--words", default="", help="what the entry states")
    parser.add_argument("--time", help="when that was, such as 2026-03-01T14:30Z; default: now")
    parser.add_argument("--until", help="of acknowledge: when the alarm returns, such as 2026-06-01")
    words = "of withdraw: kind and time of the entry to withdraw, such as service 2026-03-01"
    parser.add_argument("--of", nargs=2, metavar=("KIND", "TIME"), help=words)
    parser.add_argument(
        "--confirm", action="store_true", help="the entry's time is right, though far from all sessions"
    )
    words = "simulate a fleet into a folder, with its fleet.yaml, and monitor that; a few minutes"
    parser.add_argument("--demo", type=Path, metavar="FOLDER", help=words)
    parser.add_argument("--track", action="store_true", help="log sessions and baselines to MLflow")


def run(options: argparse.Namespace) -> int:
    from cylinder_friction.commands.estimate import cores
    from cylinder_friction.execution.selection import workers_from_environment
    from cylinder_friction.fleet.demonstration import write_demonstration
    from cylinder_friction.fleet.nightly import monitor_fleet
    from cylinder_friction.params.fleet import load_fleet

    if options.demo:
        with workers_from_environment(options.workers or cores()) as workers:
            options.fleet = write_demonstration(options.demo, workers=workers)
        options.logs, options.into = [options.demo / "logs"], options.demo / "health"
    fleet, now = load_fleet(options.fleet), datetime.now(UTC)
    _enter(options, fleet, now)
    with ExitStack() as stack:
        fleet = _with_model_folders(fleet, Path(stack.enter_context(tempfile.TemporaryDirectory())))
        workers = stack.enter_context(workers_from_environment(options.workers or cores(), MANY_CYLINDERS))
        health = monitor_fleet(options.logs, fleet, options.into, now, workers)
    problems = _copied(health, fleet, options)
    _print(health, options.json)
    print("".join(f"cylinder-friction monitor: {each}\n" for each in problems), end="", file=sys.stderr)
    health.announced()
    return health.status or int(bool(problems))


def _enter(options: argparse.Namespace, fleet: Fleet, now: datetime) -> None:
    """Add the entry that the options state, if any."""
    from cylinder_friction.fleet.entries import add_entry, refuse_far
    from cylinder_friction.fleet.one_cylinder import session_file
    from cylinder_friction.fleet.sessions import session_starts

    if not options.entry:
        if any((options.name, options.words, options.time, options.until, options.of, options.confirm)):
            given = "--name, --words, --time, --until, --of and --confirm"
            raise ValueError(f"{given} belong to an entry; give --entry CYLINDER KIND as well")
        return
    cylinder, kind = options.entry
    time = options.time or now.isoformat(timespec="seconds").replace("+00:00", "Z")
    of = " ".join(options.of or ())
    entry = Entry(cylinder, time, options.name, kind, options.words, options.until or "", of)
    if cylinder in fleet.cylinders and not options.confirm:
        refuse_far(entry, session_starts(options.into / session_file(cylinder)), now)
    add_entry(options.into, entry, fleet)


def _with_model_folders(fleet: Fleet, scratch: Path) -> Fleet:
    """Return a fleet whose registered models are folders below ``scratch``."""
    names = sorted({each.model for each in fleet.cylinders.values() if each.model})
    folders = {name: str(model_folder(name, scratch / str(number))[0]) for number, name in enumerate(names)}
    cylinders = {name: replace(each, model=folders.get(each.model, "")) for name, each in fleet.cylinders.items()}
    return replace(fleet, cylinders=cylinders)


def _copied(health: FleetHealth, fleet: Fleet, options: argparse.Namespace) -> list[str]:
    """Bring database and MLflow up to the files; return why they are not, which costs neither page nor alarm."""
    from cylinder_friction.fleet.database import update_database
    from cylinder_friction.fleet.entries import entries_of
    from cylinder_friction.fleet.one_cylinder import session_file, state_file

    problems, into = list[str](), options.into
    try:
        update_database(fleet.database, into, health.lines, entries_of(into, fleet))
    except (RecordingError, MissingExtraError) as error:
        problems.append(str(error))
    if options.track:
        from cylinder_friction.tracking.health import track_health
        from cylinder_friction.tracking.repository import TrackingError

        names = [(each.cylinder, each.state) for each in health.lines]
        files = [(name, state, into / session_file(name), into / state_file(name)) for name, state in names]
        try:
            track_health(Path.cwd(), files)
        except TrackingError as error:
            problems.append(str(error))
    return problems


def _print(health: FleetHealth, as_json: bool) -> None:
    from cylinder_friction.fleet.nightly import PAGE_FILE

    if as_json:
        print(json.dumps(health.to_dict() | {"new_alarms": health.new_alarms, "notes": health.notes}, indent=2))
        return
    lines = [f"note     {note}" for note in health.notes]
    lines += [f"{each.where}: refused: {each.reason}" for each in health.refused]
    lines += [*health.news, ""]
    shown = [each for each in health.lines if each.answer != "fine" or each.look]
    lines += [f"{each.answer:<10}{each.cylinder}: {each.words}{each.look and f' Look: {each.look}.'}" for each in shown]
    lines += [f"{'fine':<10}{len(health.lines) - len(shown)} of {len(health.lines)} cylinders"]
    lines += [f"{'ALARM':<10}new: {', '.join(health.new_alarms)}"] if health.new_alarms else []
    print("\n".join([*lines, "", f"page     {health.folder / PAGE_FILE}"]))
