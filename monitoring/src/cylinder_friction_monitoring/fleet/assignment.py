"""Decide which cylinder of a fleet a log belongs to, or refuse the log."""

import csv
import re
from collections import defaultdict
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from cylinder_friction_monitoring.errors import MonitoringError, Refused
from cylinder_friction_monitoring.fleet.plan import Assignment, Fleet

HEAD_BYTES = 1 << 16


def assigned(files: Mapping[str, Path], fleet: Fleet) -> tuple[dict[str, list[Path]], list[Refused]]:
    """Assign logs to cylinders; refuse logs that name no cylinder or several.

    ``files`` are the logs by their paths relative to the folder of logs, with ``/``. An unreadable table raises
    ``MonitoringError``.
    """
    rule = fleet.assign
    table = read_table(rule.table) if rule.table is not None else {}
    own: dict[str, list[Path]] = defaultdict(list)
    refused = []
    for name, path in files.items():
        if rule.table is not None and path.absolute() == rule.table.absolute():
            continue
        try:
            found = sorted(_named(name, path, rule, table, fleet))
        except OSError as error:
            refused.append(Refused(name, f"cannot be read ({error}); the next run tries it again"))
            continue
        known = [each for each in found if each in fleet.cylinders]
        if len(known) == 1 and len(found) == 1:
            own[known[0]].append(path)
        else:
            refused.append(Refused(name, _reason(found, known, rule)))
    return dict(own), refused


def _named(name: str, path: Path, rule: Assignment, table: Mapping[str, str], fleet: Fleet) -> set[str]:
    """Find the cylinders that a log names."""
    if rule.by == "folder":
        return set(PurePosixPath(name).parts[:-1]) & set(fleet.cylinders)
    if rule.by == "table":
        return {table[name]} if name in table else {own for glob, own in table.items() if fnmatchcase(name, glob)}
    text = name
    if rule.by == "field" and not path.is_fifo():  # opening a pipe would wait for a writer
        with path.open("rb") as file:
            text = file.read(HEAD_BYTES).replace(b"\0", b"").decode("utf-8", errors="replace")
    matches = re.finditer(rule.pattern or "", text)
    return {match["cylinder"].strip() for match in matches if match["cylinder"]}


def _reason(found: list[str], known: list[str], rule: Assignment) -> str:
    by = {
        "folder": "the folders on its path",
        "pattern": f"the pattern {rule.pattern!r} in its path",
        "table": f"{rule.table and rule.table.name}",
        "field": f"the pattern {rule.pattern!r} in its first {HEAD_BYTES >> 10} KiB",
    }[rule.by]
    if len(found) > 1:
        return f"belongs to {len(found)} cylinders, {', '.join(found)}, by {by}; expected one"
    if found and not known:
        return f"belongs to the cylinder {found[0]!r} by {by}, which fleet.yaml does not list; add it, or correct it"
    return f"belongs to no cylinder by {by}; move the log, or correct `assign` in fleet.yaml"


def read_table(path: Path) -> dict[str, str]:
    """Read a CSV file with the columns ``file`` (a path or glob) and ``cylinder``; other columns raise an error."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise MonitoringError(f"{path}: cannot be read ({error}); expected CSV in UTF-8") from None
    delimiter = max(",;\t", key=(lines[0] if lines else "").count)
    rows = csv.DictReader(lines, delimiter=delimiter)
    if not {"file", "cylinder"} <= set(rows.fieldnames or ()):
        raise MonitoringError(
            f"{path}: expected the columns file and cylinder, but got {lines[0] if lines else 'none'}"
        )
    table: dict[str, str] = {}
    for number, row in enumerate(rows, start=2):
        file, cylinder = ((row[name] or "").strip() for name in ("file", "cylinder"))
        file = file.replace("\\", "/").removeprefix("./")
        if not file or not cylinder:
            raise MonitoringError(f"{path}, line {number}: expected a file and its cylinder, but got {row}")
        if table.setdefault(file, cylinder) != cylinder:
            raise MonitoringError(f"{path}, line {number}: {file!r} belongs to {table[file]!r} already; keep one line")
    return table
