"""A recording's name, condition, session and load, from its file's path or from a table beside the files."""

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from cylinder_friction.recordings.recording import RecordingError

_REQUIRED = ("file", "condition", "session")
_WILD = frozenset("*?[")


@dataclass(frozen=True)
class PathNames:
    """What is known of a file: the recording's name, condition, session and load."""

    name: str
    condition: str
    session: str
    load: str


@dataclass(frozen=True)
class TableLine(PathNames):
    """One line of a table of names: ``number`` counted from 1 for the header, ``name`` a file's path or a glob."""

    number: int

    def fits(self, path: str) -> bool:
        return self.name == path or (bool(_WILD & set(self.name)) and fnmatchcase(path, self.name))


@dataclass(frozen=True)
class NameRules:
    """Where condition, session and load of a file come from: exactly one of the three."""

    # Regular expression on the path below the source, with groups ``condition``, ``session``, optionally ``load``
    pattern: str | None = None
    # CSV file with the columns ``file``, ``condition``, ``session``, optionally ``load``. ``file`` is a path below the
    # source, with ``/``, or a glob, where ``*`` also stands for ``/``; a path that is written out takes precedence over
    # any glob.
    table: Path | None = None
    # The condition of every file; each is then a session of its own, named as its recording
    condition: str | None = None
    _compiled: re.Pattern[str] | None = field(init=False, repr=False, compare=False, default=None)
    _lines: tuple[TableLine, ...] = field(init=False, repr=False, compare=False, default=())

    def __post_init__(self) -> None:
        if [self.pattern, self.table, self.condition].count(None) != 2:
            raise RecordingError("expected either a name pattern or a table of names, but got both or neither")
        if self.pattern is not None:
            object.__setattr__(self, "_compiled", compile_name_pattern(self.pattern))
        if self.table is not None:
            object.__setattr__(self, "_lines", read_names_table(self.table))

    def names(self, relative_path: str) -> PathNames:
        """Return what is known of a file, by its path relative to the source, with ``/``.

        Raises:
            RecordingError: The pattern does not match, the table has no line for it, or more than one glob fits it.
        """
        if self._compiled is not None:
            return names_from_path(relative_path, self._compiled)
        name = name_of(relative_path)
        if self.condition is not None:
            return PathNames(name, self.condition, name, "")
        fitting = [line for line in self._lines if line.name == relative_path]
        fitting = fitting or [line for line in self._lines if line.fits(relative_path)]
        if not fitting:
            raise RecordingError(
                f"path {relative_path!r} has no line in the table of names; add one with its condition, session"
            )
        if len(fitting) > 1:
            numbers = ", ".join(str(line.number) for line in fitting)
            raise RecordingError(
                f"path {relative_path!r} fits lines {numbers} of the table of names; expected one line per file; write "
                "the path out, or make the globs narrower"
            )
        return PathNames(name, fitting[0].condition, fitting[0].session, fitting[0].load)

    def lines_without_file(self, relative_paths: Iterable[str]) -> list[str]:
        """Return a sentence for each line of the table that no file fits; none where names come from a pattern."""
        paths = list(relative_paths)
        return [
            f"line {line.number} of the table of names: no file fits {line.name!r}; correct the line, or put the file "
            "where it belongs"
            for line in self._lines
            if not any(map(line.fits, paths))
        ]


def compile_name_pattern(pattern: str) -> re.Pattern[str]:
    """Return a pattern of file paths compiled; raise ``RecordingError`` if it is none or lacks a named group."""
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        raise RecordingError(f"name pattern {pattern!r} is not a regular expression: {error}") from None
    for group in ("condition", "session"):
        if group not in compiled.groupindex:
            raise RecordingError(
                f"name pattern {pattern!r} has no group {group!r}; write (?P<{group}>...) around the part of the "
                f"path that names the {group}"
            )
    return compiled


def names_from_path(path: str, pattern: re.Pattern[str]) -> PathNames:
    """Return what a path, relative to the ingested folder and with ``/``, states about its recording.

    The pattern is searched for anywhere in the path; it must find a condition and a session that are not empty.
    """
    match = pattern.search(path)
    groups = match.groupdict() if match else {}
    if not groups.get("condition") or not groups.get("session"):
        raise RecordingError(
            f"path {path!r} does not give condition and session: the pattern {pattern.pattern!r} finds "
            f"{'nothing in it' if match is None else groups}; rename the file or change ingest.name_pattern"
        )
    return PathNames(name_of(path), groups["condition"], groups["session"], groups.get("load") or "")


def name_of(path: str) -> str:
    """Return a recording's name: its file's path without the last suffix, with ``-`` for ``/``."""
    stem = path.rsplit(".", 1)[0] if "." in path.rsplit("/", 1)[-1] else path
    return stem.replace("/", "-")


def read_names_table(path: Path) -> tuple[TableLine, ...]:
    """Return the lines of a table of names; its delimiter is a comma, a semicolon or a tab."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"table of names {path.name!r} cannot be read: {error}; expected CSV in UTF-8") from None
    head = text.split("\n", 1)[0]
    delimiter = max(",;\t", key=head.count)
    rows = [[cell.strip() for cell in row] for row in csv.reader(text.splitlines(), delimiter=delimiter)]
    columns = [cell.casefold() for cell in rows[0]] if rows else []
    for column in _REQUIRED:
        if columns.count(column) != 1:
            raise RecordingError(
                f"table of names {path.name!r}: expected one column {column!r} in its header, but got "
                f"{', '.join(map(repr, columns)) or 'nothing'}; write file,condition,session and, if you like, load"
            )
    lines: dict[str, TableLine] = {}
    for number, row in enumerate(rows[1:], start=2):
        if not any(row):
            continue
        where = f"table of names {path.name!r}: line {number}"
        if len(row) != len(columns):
            raise RecordingError(f"{where} has {len(row)} cells, its header {len(columns)}; make them equal")
        cells = dict(zip(columns, row, strict=True))
        for column in _REQUIRED:
            if not cells[column]:
                raise RecordingError(f"{where} has no {column}; fill in the cell")
        file = cells["file"].replace("\\", "/").removeprefix("./")
        if file in lines:
            raise RecordingError(
                f"{where} is for {file!r}, which line {lines[file].number} is for already; expected one line per file"
            )
        lines[file] = TableLine(file, cells["condition"], cells["session"], cells.get("load", ""), number)
    return tuple(lines.values())
