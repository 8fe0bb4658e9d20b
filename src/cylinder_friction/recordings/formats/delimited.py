"""Text tables: comma, semicolon, tab or blank separated, with whatever a logger writes above them."""

import re
from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv

from cylinder_friction.recordings.formats.cells import (
    MISSING,
    column_values,
    holds_decimal_commas,
    is_number,
    split_cells,
    states_zone,
)
from cylinder_friction.recordings.formats.clocks import beside_clocks, joined, repeated_names, split_groups
from cylinder_friction.recordings.formats.format import Format
from cylinder_friction.recordings.formats.header import SCOPE_TIME
from cylinder_friction.recordings.formats.layout import (
    AUTOMATIC,
    CsvOptions,
    Layout,
    find_layout,
)
from cylinder_friction.recordings.formats.logged_table import Column, LoggedTable, LongTable
from cylinder_friction.recordings.formats.source import HEAD_SIZE, MOST_INDIVISIBLE, FileSource, Text, open_text
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import Start, start_in_header

_FEWEST_LINES = 20
LARGEST_STEP = 4.0
"""From one row to the next a value changes by no more than so many times its largest change in the rows before."""
_LARGEST_HEAD, _SHORT_HEAD = 64 * HEAD_SIZE, HEAD_SIZE // 8


def read_delimited(
    source: FileSource, wanted: Collection[str] | None, options: CsvOptions = AUTOMATIC
) -> list[LoggedTable]:
    """Return the table of a text file. Its first lines show the layout; Arrow reads the rows in one pass.

    A file with several time columns of one name gives a table for each, with the channels behind it.

    Raises:
        RecordingError: The file is no such table: another encoding, no rows of numbers, a line with more or fewer
            values than the others, a header that comes again, or dates with two readings.
    """
    try:
        return _read(open_text(source, options.encoding), options, wanted)
    except UnicodeDecodeError as error:
        if options.encoding != "auto" or not source.head.isascii():
            raise _not_utf8(error) from None
        return _read(open_text(source, "cp1252"), options, wanted)


def _not_utf8(error: UnicodeDecodeError) -> RecordingError:
    return RecordingError(
        f"its characters are not UTF-8: {error.reason}; name the right encoding, such as csv: {{encoding: cp1252}} in "
        "the mapping, or save it as UTF-8"
    )


def long_delimited(
    source: FileSource, wanted: Collection[str] | None, rows: int, options: CsvOptions = AUTOMATIC
) -> LongTable | None:
    """Return a text file of many more rows than these, to be read in parts of about that size; None for a shorter one.

    Each part is a run of whole lines, read as a file by itself, so that memory holds one of them.
    """
    text = open_text(source, options.encoding)
    lines, layout = _first_lines(text, options)
    if repeated := repeated_names(layout.names):
        if source.size > MOST_INDIVISIBLE:
            raise RecordingError(
                f"is too large to be read whole ({source.size / 1e6:.0f} MB, at most {MOST_INDIVISIBLE / 1e6:.0f} MB), "
                f"and its columns of one name ({', '.join(sorted(repeated))}) end at rows of their own, so that it "
                "cannot be read in parts; export it with one time column, or split it"
            )
        return None
    below = lines[layout.first_row :]
    step = max(1, sum(map(len, below)) // len(below)) * rows
    begin = text.start + sum(map(len, lines[: layout.first_row]))
    if text.end - begin <= step:
        return None
    start = _start(lines, layout)

    def read(first: int, last: int) -> LoggedTable:
        part = replace(text, end=last, notes=text.notes if first == begin else ())
        try:
            return _tables(_Rows(part, layout, first, begin, start), wanted)[0]
        except UnicodeDecodeError as error:
            raise _not_utf8(error) from None

    def chunks() -> Iterator[LoggedTable]:
        first = begin
        while first < text.end:
            last = _line_end(text, first + step)
            yield read(first, last)
            first = last

    return LongTable(-(-(text.end - begin) // step), chunks)


def _line_end(text: Text, place: int) -> int:
    """Return the byte behind the end of the line that contains ``place``, at most the end of the text."""
    while place < text.end:
        block = text.file.read_at(min(HEAD_SIZE, text.end - place), place)
        if (found := block.find(b"\n")) >= 0:
            return int(place + found + 1)
        place += len(block)
    return text.end


def _read(text: Text, options: CsvOptions, wanted: Collection[str] | None) -> list[LoggedTable]:
    lines, layout = _first_lines(text, options)
    begin = text.start + sum(map(len, lines[: layout.first_row]))
    return _tables(_Rows(text, layout, begin, begin, _start(lines, layout)), wanted)


def _start(lines: list[bytes], layout: Layout) -> Start | None:
    return start_in_header([line.decode() for line in lines[: layout.first_row]], layout.delimiter)


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
    columns: list[Column] = []
    units, utc, clocks, notes = dict(layout.units), False, [], list(text.notes)
    for index, column in zip(loaded, table.columns, strict=True):
        name = names[index]
        utc |= states_zone(column)
        if pa.types.is_string(column.type):
            rows.refuse_second_header(column, name)
        try:
            cells = column_values(column, decimal, name)
        except RecordingError:
            if wanted is None or name in wanted:
                raise
            continue
        units |= {name: cells.unit} if cells.unit else {}
        notes += [cells.note] if cells.note else []
        clocks += [name] if cells.clock else []
        if name or not pd.isna(cells.values).all():
            columns.append((name or f"column_{index + 1}", cells.values))
    first, *others = split_groups(joined(columns, clocks, wanted), units, repeated)
    unread = tuple(name for name in unread if name not in first.channels)
    first = replace(first, unread=unread, notes=(*notes, *filter(None, [rows.ended]), *first.notes))
    return [replace(each, start=rows.start, utc=utc) for each in (first, *others)]


def _first_lines(text: Text, options: CsvOptions) -> tuple[list[bytes], Layout]:
    """Return enough of the first whole lines to contain names and rows, and their layout."""
    size = HEAD_SIZE
    while True:
        head = text.file.read_at(min(size, text.end - text.start), text.start)
        lines: list[bytes] = head.splitlines(keepends=True)
        whole = size >= text.end - text.start
        if whole or len(lines) > _FEWEST_LINES or size >= _LARGEST_HEAD:
            lines = lines if whole else lines[:-1]
            try:
                return lines, find_layout([line.decode() for line in lines], options)
            except RecordingError:  # what stands above the rows may be long
                if whole or size >= _LARGEST_HEAD:
                    raise
        size *= 4


class _Rows:
    """The rows of a text table from byte ``begin`` on. It can name the line of a row that is wrong.

    ``first`` is the byte where the first row of all begins, ``start`` what the lines above it state.
    """

    def __init__(self, text: Text, layout: Layout, begin: int, first: int, start: Start | None) -> None:
        self.text, self.layout, self.begin, self.first, self.start = text, layout, begin, first, start
        self.ended = ""  # That channels end before others, in words

    def parsed(self, loaded: list[int]) -> tuple[Any, str]:
        """Return the columns of these numbers as a ``pyarrow.Table``, and the decimal sign they were read with."""
        layout = self.layout
        table = self._parsed(loaded, layout.decimal or ".")
        # Whole numbers at first, and the first decimal sign further down than was looked.
        if layout.decimal is None and layout.delimiter != ",":
            texts = [column for column in table.columns if pa.types.is_string(column.type)]
            floats = any(pa.types.is_floating(column.type) for column in table.columns)
            if not floats and any(holds_decimal_commas(column) for column in texts):
                return self._parsed(loaded, ","), ","
        return table, layout.decimal or "."

    def _parsed(self, loaded: list[int], decimal: str, *, quick: bool = True) -> Any:
        width = len(self.layout.names)
        delimiter = "\t" if self.layout.delimiter == "whitespace" else self.layout.delimiter
        try:
            table = pa_csv.read_csv(
                self._stream(),
                read_options=pa_csv.ReadOptions(use_threads=False, column_names=[str(index) for index in range(width)]),
                parse_options=pa_csv.ParseOptions(
                    delimiter=delimiter, ignore_empty_lines=width > 1, quote_char=self.text.quote
                ),
                convert_options=pa_csv.ConvertOptions(
                    decimal_point=decimal,
                    null_values=MISSING,
                    strings_can_be_null=True,
                    column_types=self._fractions(decimal) if quick else None,
                    include_columns=[str(index) for index in loaded],
                ),
            )
        except pa.ArrowInvalid as error:
            if quick:
                return self._parsed(loaded, decimal, quick=False)
            if self.layout.names[0] == SCOPE_TIME and not self.ended and (ended := self._ended_early()):
                self.ended = ended
                return self._parsed(loaded, decimal)
            self._refuse_ragged_line()
            raise RecordingError(f"cannot be read as a text table: {error}") from None
        if any(pa.types.is_binary(column.type) for column in table.columns):
            raise UnicodeDecodeError("utf-8", b"", 0, 1, "a character further down is not UTF-8")
        return table

    def _fractions(self, decimal: str) -> dict[str, Any]:
        """Return the type of columns whose first number has decimals: Arrow need not try every other type first."""
        head: bytes = self.text.file.read_at(min(_SHORT_HEAD, self.text.end - self.begin), self.begin)
        cells = split_cells(head.partition(b"\n")[0].decode(errors="replace"), self.layout.delimiter)
        return {str(at): pa.float64() for at, cell in enumerate(cells) if decimal in cell and is_number(cell, decimal)}

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
        """Return that the last rows lack channels that ended before, as a scope writes them; empty if they may not.

        The first short row must go on where the row before ended: its cells may be those of other channels.
        """
        names, rows = self.layout.names, [split_cells(line, self.layout.delimiter) for _, line in self._lines()]
        widths = [len(row) for row in rows]
        whole = widths.count(len(names))
        if (
            whole < _FEWEST_LINES
            or whole == len(rows)
            or widths[0] > len(names)
            or widths != sorted(widths, reverse=True)
        ):
            return ""
        shared = [row[: widths[whole]] for row in rows[whole - _FEWEST_LINES : whole + 1]]
        try:
            steps = np.abs(np.diff(np.array(shared, dtype=np.float64), axis=0))
            _ = [np.array(row, dtype=np.float64) for row in rows[whole:]]
            slack = 1e-6 * np.abs(np.array(shared[-2], dtype=np.float64))
        except ValueError:
            return ""
        if (steps[-1] > LARGEST_STEP * steps[:-1].max(axis=0) + slack).any():
            return ""
        return (
            f"the last {len(rows) - whole} rows hold {widths[-1]} of {len(names)} values: {names[widths[-1]]!r} and "
            "the channels behind it end before the others"
        )

    def _padded(self, content: bytes) -> bytes:
        """Pad every row to as many cells as there are names, for a group may end before the others."""
        lines = [line for line in re.split(rb"\r\n|\n|\r", content) if line]
        delimiter, width = self.layout.delimiter.encode(), len(self.layout.names)
        missing = [width - 1 - line.count(delimiter) for line in lines]
        if any(before > after for before, after in pairwise(missing)):
            self._refuse_ragged_line()
        return b"\n".join(line + delimiter * count for line, count in zip(lines, missing, strict=True))

    def _lines(self) -> list[tuple[int, str]]:
        """Return the rows that are not empty, each with its number within the file, counted from 1."""
        content = self.text.file.read_at(self.text.end - self.begin, self.begin).decode(errors="replace")
        above = self.layout.first_row + self._lines_before()
        lines = enumerate(re.split(r"\r\n|\n|\r", content), start=above + 1)
        return [(number, line) for number, line in lines if line or len(self.layout.names) == 1]

    def _lines_before(self) -> int:
        read_at = self.text.file.read_at
        places = range(self.first, self.begin, HEAD_SIZE)
        return sum(read_at(min(HEAD_SIZE, self.begin - place), place).count(b"\n") for place in places)

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
        """Refuse a column that contains its own name: the logger was started twice with one file."""
        row = pc.index(pc.utf8_trim_whitespace(column), name).as_py()
        if row >= 0:
            number, line = self._lines()[row]
            raise RecordingError(
                f"line {number} is the header again: {line[:80]!r}; two logs in one file have two clocks; "
                "cut the file in two there"
            )


FORMAT = Format("csv", "a text table", read_delimited, read_long=long_delimited, options=True)
"""Any text table."""
