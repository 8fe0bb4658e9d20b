"""Run ``cylinder-friction monitor``: add an entry, process the fleet, update database and MLflow, print the result."""

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from cylinder_friction_monitoring.fleet.database import update_database
from cylinder_friction_monitoring.fleet.demonstration import write_demonstration
from cylinder_friction_monitoring.fleet.entries import add_entry, entries_of
from cylinder_friction_monitoring.fleet.files import session_file, state_file
from cylinder_friction_monitoring.fleet.fleet_file import REGISTERED, load_fleet
from cylinder_friction_monitoring.fleet.nightly import PAGE_FILE, FleetHealth, monitor_fleet
from cylinder_friction_monitoring.fleet.plan import Fleet
from cylinder_friction_monitoring.fleet.processes import cores
from cylinder_friction_monitoring.trends.assessment import Entry

MANY_CYLINDERS = 8  # Fewest cylinders for which more than one process is faster
EXPECTED = (ValueError, OSError)


def run(options: argparse.Namespace) -> int:
    """Run the command ``monitor`` and return its exit status."""
    if options.demo:
        options.fleet = write_demonstration(options.demo, processes=options.workers or cores())
        options.logs, options.into = [options.demo / "logs"], options.demo / "health"
    fleet, now = load_fleet(options.fleet), datetime.now(UTC)
    _enter(options, fleet, now)
    few = len(fleet.cylinders) < MANY_CYLINDERS
    with tempfile.TemporaryDirectory() as scratch:
        fleet, waiting = _with_model_folders(fleet, Path(scratch))
        workers = options.workers or (1 if few else cores())
        health = monitor_fleet(options.logs, fleet, options.into, now, workers, waiting)
    problems = _copied(health, fleet, options)
    _print(health, options.json)
    print("".join(f"cylinder-friction monitor: {each}\n" for each in problems), end="", file=sys.stderr)
    health.announced()
    return health.status or int(bool(problems))


def _enter(options: argparse.Namespace, fleet: Fleet, now: datetime) -> None:
    """Add the entry that the options state, if any."""
    if not options.entry:
        if any((options.name, options.words, options.time, options.until, options.of)):
            given = "--name, --words, --time, --until and --of"
            raise ValueError(f"{given} belong to an entry; give --entry CYLINDER KIND as well")
        return
    cylinder, kind = options.entry
    time = options.time or now.isoformat(timespec="seconds").replace("+00:00", "Z")
    of = " ".join(options.of or ())
    entry = Entry(cylinder, time, options.name, kind, options.words, options.until or "", of)
    add_entry(options.into, entry, fleet)


def _with_model_folders(fleet: Fleet, scratch: Path) -> tuple[Fleet, dict[str, str]]:
    """Replace the registered models of a fleet by copies below ``scratch``.

    Also return, by cylinder, why its model cannot be copied. Its logs wait: without a model, all would be made again.
    """
    folders, problems = dict[str, str](), dict[str, str]()
    names = {each.model for each in fleet.cylinders.values() if each.model.startswith(REGISTERED)}
    for number, name in enumerate(sorted(names)):
        from cylinder_friction.tracking.lineage import estimator_folder  # MLflow: only for registered models

        try:
            folders[name] = str(estimator_folder(name, Path(), scratch / str(number))[0])
        except RuntimeError as error:  # the registry cannot be reached, or has no such model
            problems[name] = str(error)
    cylinders = {
        name: replace(each, model=folders.get(each.model, each.model)) for name, each in fleet.cylinders.items()
    }
    waiting = {name: problems[each.model] for name, each in cylinders.items() if each.model in problems}
    return replace(fleet, cylinders=cylinders), waiting


def _copied(health: FleetHealth, fleet: Fleet, options: argparse.Namespace) -> list[str]:
    """Update database and MLflow from the files. Return errors, on which page and alarms do not depend."""
    problems, into = list[str](), options.into
    lines = [each for each in health.lines if (into / state_file(each.cylinder)).is_file()]
    try:
        update_database(fleet.database, into, lines, entries_of(into, fleet, []))
    except Exception as error:  # a file or a driver may raise anything
        problems.append(str(error))
    if options.track:
        from cylinder_friction_monitoring.tracking import track_health  # MLflow: only if it is asked for

        files = [(each.cylinder, each.state, session_file(each.cylinder), state_file(each.cylinder)) for each in lines]
        try:
            track_health(Path.cwd(), [(name, state, into / table, into / known) for name, state, table, known in files])
        except Exception as error:  # the store or the server may raise anything
            problems.append(str(error))
    return problems


def _print(health: FleetHealth, as_json: bool) -> None:
    if as_json:
        print(json.dumps(health.to_dict() | {"new_alarms": health.new_alarms, "notes": health.notes}, indent=2))
        return
    lines = [f"note     {note}" for note in health.notes]
    lines += [f"{each.where}: refused: {each.reason}" for each in health.refused]
    lines += [*health.news, ""]
    shown = [each for each in health.lines if each.answer != "fine" or each.look]
    lines += [f"{each.answer:<10}{each.cylinder}: {each.words}{each.look and f' Look: {each.look}.'}" for each in shown]
    fine = sum(each.answer == "fine" for each in health.lines)
    lines += [f"{'fine':<10}{fine} of {len(health.lines)} cylinders"]
    lines += [f"{'ALARM':<10}new: {', '.join(health.new_alarms)}"] if health.new_alarms else []
    print("\n".join([*lines, "", f"page     {health.folder / PAGE_FILE}"]))
