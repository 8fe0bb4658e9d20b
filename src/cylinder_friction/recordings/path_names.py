"""Find a recording's name, condition, session and load, from its file's path or from a table beside the files."""

import csv
import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from unicodedata import category

from cylinder_friction.recordings.recording import RecordingError

ONE_CONDITION = "1"
"""Condition of files whose names state none."""
_REQUIRED = ("file", "condition", "session")


@dataclass(frozen=True)
class PathNames:
    """Name, condition, session, load and machine of a file's recording."""

    name: str
    condition: str
    session: str
    load: str = ""
    asset: str = ""


@dataclass(frozen=True)
class NameRules:
    """Source of a file's condition, session and load: exactly one of a pattern, a table, or a fixed condition."""

    # Regular expression for the path below the source, with the group ``session`` and optionally ``condition`` (by
    # default "1" for all files), ``load`` and ``asset``
    pattern: str | None = None
    # CSV file with the columns ``file`` (a path below the source), ``condition``, ``session``, optionally ``load`` and
    # ``asset``
    table: Path | None = None
    # Condition of every file. Each file is then a session of its own, named as its recording
    condition: str | None = None

    def __post_init__(self) -> None:
        if [self.pattern, self.table, self.condition].count(None) != 2:
            raise RecordingError("expected either a name pattern or a table of names, but got both or neither")
        _ = self._compiled, self._lines  # refuse a wrong pattern or table at once

    @cached_property
    def _compiled(self) -> re.Pattern[str] | None:
        return None if self.pattern is None else compile_name_pattern(self.pattern)

    @cached_property
    def _lines(self) -> dict[str, PathNames]:
        return {} if self.table is None else read_names_table(self.table)

    def names(self, relative_path: str) -> PathNames:
        """Find the names of a file by its path relative to the source, with ``/``.

        Raises:
            RecordingError: The pattern does not match, the table has no line for the file, or the name is not allowed
                on other systems.
        """
        if "\\" in relative_path or {"Cc", "Cs"} & set(map(category, relative_path)):
            raise RecordingError(
                f"path {relative_path!r} holds a backslash, a control character or bytes that are not UTF-8; rename "
                "the file"
            )
        name = name_of(relative_path)
        if self.condition is not None:
            return PathNames(name, self.condition, name, "")
        if self._compiled is None:
            if relative_path not in self._lines:
                raise RecordingError(
                    f"path {relative_path!r} has no line in the table of names; add one with its condition, session"
                )
            return replace(self._lines[relative_path], name=name)
        match = self._compiled.search(relative_path)
        groups = {"condition": ONE_CONDITION, **match.groupdict()} if match else {}
        if not groups.get("condition") or not groups.get("session"):
            raise RecordingError(
                f"path {relative_path!r} does not give condition and session: the pattern {self.pattern!r} finds "
                f"{'nothing in it' if match is None else groups}; rename the file, or change the "
                "pattern: name_pattern in the mapping, or --names"
            )
        return PathNames(name, *(groups.get(each) or "" for each in ("condition", "session", "load", "asset")))

    def finds(self, relative_path: str) -> bool:
        """Check whether the pattern matches a file's path."""
        return self._compiled is not None and self._compiled.search(relative_path) is not None

    def lines_without_file(self, relative_paths: Collection[str]) -> list[str]:
        """Write a sentence for each line of the table without a file; empty if names come from a pattern."""
        return [
            f"the table of names has a line for {file!r}, which is not there; correct the line, or put the file where "
            "it belongs"
            for file in self._lines
            if file not in relative_paths
        ]


def compile_name_pattern(pattern: str) -> re.Pattern[str]:
    """Compile a pattern for file paths; raise ``RecordingError`` if it is invalid or lacks a named group."""
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        raise RecordingError(f"name pattern {pattern!r} is not a regular expression: {error}") from None
    if "session" not in compiled.groupindex:
        raise RecordingError(
            f"name pattern {pattern!r} has no group 'session'; write (?P<session>...) around the part of the path that "
            "names the session"
        )
    return compiled


def name_of(path: str) -> str:
    """Make a recording's name from its file's path: drop the last suffix and replace ``/`` by ``-``."""
    stem = path.rsplit(".", 1)[0] if "." in path.rsplit("/", 1)[-1] else path
    return stem.replace("/", "-")


def read_names_table(path: Path) -> dict[str, PathNames]:
    """Read a table of names by file; its delimiter is a comma, a semicolon or a tab."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"table of names {path.name!r} cannot be read: {error}; expected CSV in UTF-8") from None
    delimiter = max(",;\t", key=text.split("\n", 1)[0].count)
    rows = [[cell.strip() for cell in row] for row in csv.reader(text.splitlines(), delimiter=delimiter)]
    columns = [cell.casefold() for cell in rows[0]] if rows else []
    if missing := [column for column in _REQUIRED if columns.count(column) != 1]:
        raise RecordingError(
            f"table of names {path.name!r}: expected one column {missing[0]!r} in its header, but got "
            f"{', '.join(map(repr, columns)) or 'nothing'}; write file,condition,session (and perhaps load, asset)"
        )
    lines: dict[str, PathNames] = {}
    for number, row in enumerate(rows[1:], start=2):
        if not any(row):
            continue
        where = f"table of names {path.name!r}: line {number}"
        cells = dict(zip(columns, row, strict=False))
        if len(row) != len(columns):
            raise RecordingError(f"{where} has {len(row)} cells, its header {len(columns)}; make them equal")
        if empty := [column for column in _REQUIRED if not cells[column]]:
            raise RecordingError(f"{where} has no {empty[0]}; fill in the cell")
        file = cells["file"].replace("\\", "/").removeprefix("./")
        if file in lines:
            raise RecordingError(f"{where} is for {file!r} again; expected one line per file")
        lines[file] = PathNames(file, *(cells.get(name, "") for name in ("condition", "session", "load", "asset")))
    return lines
