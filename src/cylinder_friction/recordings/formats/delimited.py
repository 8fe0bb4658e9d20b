"""Read text tables separated by comma, semicolon, tab or blanks, with any lines of a logger above them."""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv

from cylinder_friction.recordings.formats.cells import MISSING, holds_decimal_commas, split_cells
from cylinder_friction.recordings.formats.clocks import beside_clocks, columns_of, repeated_names, split_groups
from cylinder_friction.recordings.formats.format import Format, LoggedTable
from cylinder_friction.recordings.formats.layout import AUTOMATIC, SCOPE_TIME, CsvOptions, Layout, find_layout
from cylinder_friction.recordings.formats.source import HEAD_SIZE, MOST_INDIVISIBLE, FileSource, Text, open_text
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import Start, start_in_header

_FEWEST_LINES = 20
LARGEST_STEP = 4.0
"""Largest change of a value to the next row, as a multiple of its largest change in the rows before."""
_LARGEST_HEAD, _USUAL_LINES = 64 * HEAD_SIZE, 500


def read_delimited(
    source: FileSource, wanted: Collection[str] | None, csv: CsvOptions = AUTOMATIC, rows: int | None = None
) -> list[LoggedTable]:
    """Read the table of a text file: find the layout in its first lines, then parse the rows with Arrow in one pass.

    A file with several time columns of one name gives a table for each, with the channels after it. A file with many
    more than ``rows`` rows is read in parts of about ``rows`` whole lines, so that memory holds only one part.

    Raises:
        RecordingError: The file is not such a table: it has another encoding, no rows of numbers, a line with more or
            fewer values than the others, a repeated header, or ambiguous dates.
    """
    try:
        return _read(source, open_text(source, csv.encoding), wanted, csv, rows)
    except UnicodeDecodeError as error:
        if csv.encoding == "auto" and source.head.isascii() and (rows is None or source.size <= MOST_INDIVISIBLE):
            return _read(source, open_text(source, "cp1252"), wanted, csv, rows)
        raise _not_utf8(error) from None


def _not_utf8(error: UnicodeDecodeError) -> RecordingError:
    return RecordingError(
        f"its characters are not UTF-8: {error.reason}; name the right encoding, such as csv: {{encoding: cp1252}} in "
        "the mapping, or save it as UTF-8"
    )


def _read(
    source: FileSource, text: Text, wanted: Collection[str] | None, csv: CsvOptions, rows: int | None
) -> list[LoggedTable]:
    lines, layout = _first_lines(text, csv)
    begin = text.start + sum(map(len, lines[: layout.first_row]))
    start = start_in_header([line.decode() for line in lines[: layout.first_row]], layout.delimiter)
    below = lines[layout.first_row :]
    step = text.end if rows is None else max(1, sum(map(len, below)) // len(below)) * rows
    whole, repeated = _Rows(text, layout, begin, begin, start), repeated_names(layout.names)
    if text.end - begin > step and repeated and source.size > MOST_INDIVISIBLE:
        raise RecordingError(
            f"is too large to be read whole ({source.size / 1e6:.0f} MB, at most {MOST_INDIVISIBLE / 1e6:.0f} MB), and "
            f"its columns of one name ({', '.join(sorted(repeated))}) end at rows of their own, so that it cannot be "
            "read in parts; export it with one time column, or split it"
        )
    if text.end - begin <= step or repeated:
        return _tables(whole, wanted)
    end = _line_end(text, begin + step)
    (first,) = _tables(replace(whole, text=replace(text, end=end)), wanted)
    later = partial(_parts, replace(whole, text=replace(text, notes=()), begin=end), step, wanted)
    return [replace(first, more=later, parts=-(-(text.end - begin) // step))]


def _parts(rows: "_Rows", step: int, wanted: Collection[str] | None) -> Iterator[LoggedTable]:
    begin = rows.begin
    while begin < rows.text.end:
        end = _line_end(rows.text, begin + step)
        try:
            yield _tables(replace(rows, text=replace(rows.text, end=end), begin=begin), wanted)[0]
        except UnicodeDecodeError as error:
            raise _not_utf8(error) from None
        begin = end


def _line_end(text: Text, place: int) -> int:
    """Find the byte after the line that contains ``place``, at most the end of the text."""
    while place < text.end:
        block = text.file.read_at(min(HEAD_SIZE, text.end - place), place)
        if (found := block.find(b"\n")) >= 0:
            return int(place + found + 1)
        place += len(block)
    return text.end


def _tables(rows: "_Rows", wanted: Collection[str] | None) -> list[LoggedTable]:
    text, layout, names = rows.text, rows.layout, rows.layout.names
    asked = set(names) if wanted is None else set(wanted) - {""}
    unread = tuple(name for name in names if name and name not in asked)
    if asked.isdisjoint(names):
        return [LoggedTable(pd.DataFrame(), layout.units, unread=unread, notes=text.notes)]
    repeated = repeated_names(names)
    asked |= repeated | beside_clocks(names)
    loaded = [index for index, name in enumerate(names) if name in asked]
    table, decimal = rows.parsed(loaded)
    named = [(names[index], column) for index, column in zip(loaded, table.columns, strict=True)]
    for name, column in named:
        if pa.types.is_string(column.type):
            rows.refuse_second_header(column, name)
    found = columns_of(named, decimal, wanted)
    columns = [
        (name or f"column_{len(names)}", each) for name, each in found.columns if name or not pd.isna(each).all()
    ]
    first, *others = split_groups(columns, {**layout.units, **found.units}, repeated)
    unread = tuple(name for name in unread if name not in first.channels)
    notes = (*text.notes, *found.notes, *filter(None, [rows.ended]), *first.notes)
    return [
        replace(each, start=rows.start, utc=found.utc) for each in (replace(first, unread=unread, notes=notes), *others)
    ]


def _first_lines(text: Text, options: CsvOptions) -> tuple[list[bytes], Layout]:
    """Read enough of the first whole lines to contain names and rows, and find their layout."""
    size = HEAD_SIZE
    while True:
        head = text.file.read_at(min(size, text.end - text.start), text.start)
        lines: list[bytes] = head.splitlines(keepends=True)
        if size < text.end - text.start:
            lines = lines[:-1] if len(lines) > _FEWEST_LINES or size >= _LARGEST_HEAD else []
        for most in (_USUAL_LINES, len(lines)):  # the lines above the rows may be many
            try:
                return lines, find_layout([line.decode() for line in lines[:most]], options)
            except RecordingError:
                if most >= len(lines) and size >= min(_LARGEST_HEAD, text.end - text.start):
                    raise
        size *= 4


@dataclass
class _Rows:
    """The rows of a text table from byte ``begin`` on; errors name the line of a wrong row."""

    text: Text
    layout: Layout
    begin: int
    first: int  # The byte where the first row of the table begins
    start: Start | None  # The start that the lines above the rows state
    ended: str = ""  # A sentence if channels end before others

    def parsed(self, loaded: list[int]) -> tuple[Any, str]:
        """Parse the columns with these numbers. Return a ``pyarrow.Table`` and the decimal sign that was used."""
        sign = self.layout.decimal or "."
        table = self._parsed(loaded, sign)
        # The first lines have whole numbers, so that the decimal sign occurs only further down.
        if self.layout.decimal is None and self.layout.delimiter != ",":
            texts = [column for column in table.columns if pa.types.is_string(column.type)]
            floats = any(pa.types.is_floating(column.type) for column in table.columns)
            if not floats and any(holds_decimal_commas(column) for column in texts):
                sign, table = ",", self._parsed(loaded, ",")
        return table, sign

    def _parsed(self, loaded: list[int], decimal: str) -> Any:
        width = len(self.layout.names)
        delimiter = "\t" if self.layout.delimiter == "whitespace" else self.layout.delimiter
        names, included = [str(index) for index in range(width)], [str(index) for index in loaded]
        reading = pa_csv.ReadOptions(use_threads=False, column_names=names)
        parsing = pa_csv.ParseOptions(delimiter=delimiter, ignore_empty_lines=width > 1, quote_char=self.text.quote)
        cells = pa_csv.ConvertOptions(
            decimal_point=decimal, null_values=MISSING, strings_can_be_null=True, include_columns=included
        )
        try:
            table = pa_csv.read_csv(self._stream(), reading, parsing, cells)
        except pa.ArrowInvalid as error:
            if self.layout.names[0] == SCOPE_TIME and not self.ended and (ended := self._ended_early()):
                self.ended = ended
                return self._parsed(loaded, decimal)
            self._refuse_ragged_line()
            raise RecordingError(f"cannot be read as a text table: {error}") from None
        if any(pa.types.is_binary(column.type) for column in table.columns):
            raise UnicodeDecodeError("utf-8", b"", 0, 1, "a character further down is not UTF-8")
        return table

    def _stream(self) -> Any:
        length = self.text.end - self.begin
        spaces = self.layout.delimiter == "whitespace"
        padded = self.ended or (not spaces and repeated_names(self.layout.names))
        if not (spaces or padded):
            return self.text.file.get_stream(self.begin, length)
        content = self.text.file.read_at(length, self.begin)
        if padded:
            return pa.BufferReader(self._padded(content))
        content = re.sub(rb"[ \t]+", b"\t", content)
        for outside, end in ((b"\n\t", b"\n"), (b"\r\t", b"\r"), (b"\t\n", b"\n"), (b"\t\r", b"\r")):
            content = content.replace(outside, end)
        return pa.BufferReader(content.strip(b"\t"))

    def _ended_early(self) -> str:
        """State that channels ended early, if the last rows are shorter, as a scope writes them; empty otherwise.

        The first short row must continue the row before, because its cells could belong to other channels.
        """
        names, rows = self.layout.names, [split_cells(line, self.layout.delimiter) for _, line in self._lines()]
        widths = [len(row) for row in rows]
        whole = widths.count(len(names))
        falling = widths == sorted(widths, reverse=True) and widths[0] == len(names)
        if not (falling and _FEWEST_LINES <= whole < len(rows)):
            return ""
        try:
            values = np.array(
                [row[: widths[whole]] for row in rows[whole - _FEWEST_LINES : whole + 1]], dtype=np.float64
            )
            _ = [np.array(row, dtype=np.float64) for row in rows[whole:]]
        except ValueError:
            return ""
        steps = np.abs(np.diff(values, axis=0))
        if (steps[-1] > LARGEST_STEP * steps[:-1].max(axis=0) + 1e-6 * np.abs(values[-2])).any():
            return ""
        return (
            f"the last {len(rows) - whole} rows hold {widths[-1]} of {len(names)} values: {names[widths[-1]]!r} and "
            "the channels behind it end before the others"
        )

    def _padded(self, content: bytes) -> bytes:
        """Pad every row to the number of names, because a group may end before the others."""
        lines = [line for line in re.split(rb"\r\n|\n|\r", content) if line]
        delimiter, width = self.layout.delimiter.encode(), len(self.layout.names)
        missing = [width - 1 - line.count(delimiter) for line in lines]
        if any(before > after for before, after in pairwise(missing)):
            self._refuse_ragged_line()
        return b"\n".join(line + delimiter * count for line, count in zip(lines, missing, strict=True))

    def _lines(self) -> list[tuple[int, str]]:
        """List the rows that are not empty, each with its line number in the file, counted from 1."""
        read_at, places = self.text.file.read_at, range(self.first, self.begin, HEAD_SIZE)
        before = sum(read_at(min(HEAD_SIZE, self.begin - place), place).count(b"\n") for place in places)
        content = read_at(self.text.end - self.begin, self.begin).decode(errors="replace")
        lines = enumerate(re.split(r"\r\n|\n|\r", content), start=self.layout.first_row + before + 1)
        return [(number, line) for number, line in lines if line or len(self.layout.names) == 1]

    def _refuse_ragged_line(self) -> None:
        width = len(self.layout.names)
        for number, line in self._lines():
            if (count := len(split_cells(line, self.layout.delimiter))) != width:
                raise RecordingError(
                    f"line {number} holds {count} values: {line[:80]!r}; expected {width} as in the lines above it; "
                    "correct the line, or cut the file there if it holds two logs"
                    + (", or export it separated by tab or semicolon" if self.layout.delimiter == "whitespace" else "")
                )

    def refuse_second_header(self, column: Any, name: str) -> None:
        """Refuse a column that contains its own name, because the logger was started twice with one file."""
        row = pc.index(pc.utf8_trim_whitespace(column), name).as_py()
        if row >= 0:
            number, line = self._lines()[row]
            raise RecordingError(
                f"line {number} is the header again: {line[:80]!r}; two logs in one file have two clocks; "
                "cut the file in two there"
            )


FORMAT = Format("csv", "a text table", read_delimited, ("csv", "rows"))
"""Any text table."""
