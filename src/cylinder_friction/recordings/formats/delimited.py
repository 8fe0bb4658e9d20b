"""Read text tables separated by comma, semicolon, tab or blanks, with any lines of a logger above them."""

from __future__ import annotations

import codecs
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv

from cylinder_friction.recordings.formats.cells import (
    FILETIME,
    beside_clocks,
    columns_of,
    dates_of,
    holds_decimal_commas,
    way_of,
)
from cylinder_friction.recordings.formats.format import (
    BYTE_ORDER_MARKS,
    HEAD_SIZE,
    Column,
    FileSource,
    Format,
    LoggedTable,
    named_columns,
)
from cylinder_friction.recordings.formats.layout import (
    AUTOMATIC,
    CLOCK,
    DATE,
    MISSING,
    SCOPE_TIME,
    CsvOptions,
    Layout,
    find_layout,
    repeated_names,
    split_cells,
)
from cylinder_friction.recordings.recording import RecordingError, Start

MOST_INDIVISIBLE = 256 * 10**6
"""Largest text that is read whole if it cannot be read in parts [bytes]."""
_FEWEST_LINES, _USUAL_LINES = 20, 500
_LARGEST_HEAD = 64 * HEAD_SIZE
LARGEST_STEP = 4.0
"""Largest change of a value to the next row, as a multiple of its largest change in the rows before."""
_TAIL = 1 << 16
_READ_AT_ONCE = 1 << 22  # Largest file that is held in memory [bytes]
_EOF = re.compile(rb"(?<=[\r\n])[\s;,|\"]*EOF(?:[\s;,|\"]|EOF)*\Z")


def read_delimited(
    source: FileSource, wanted: Collection[str] | None, csv: CsvOptions = AUTOMATIC, rows: int | None = None
) -> list[LoggedTable]:
    """Read the table of a text file: find the layout in its first lines, then parse the rows with Arrow in one pass.

    A file with several time columns of one name gives a table for each, with the channels after it. A file with many
    more than ``rows`` rows is read in equal parts of about ``rows`` whole lines, so that memory holds only one part.

    Raises:
        RecordingError: The file is not such a table: it has another encoding, no rows of numbers, a line with more or
            fewer values than the others, or ambiguous dates.
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
    row_size, size = max(1, sum(map(len, below)) // len(below)), text.end - begin
    parts = 1 if rows is None else max(1, round(size / row_size / rows))
    whole, repeated = _Rows(text, layout, begin, begin, start), repeated_names(layout.names)
    if parts > 1 and repeated and source.size > MOST_INDIVISIBLE:
        raise RecordingError(
            f"is too large to be read whole ({source.size / 1e6:.0f} MB, at most {MOST_INDIVISIBLE / 1e6:.0f} MB), and "
            f"its columns of one name ({', '.join(sorted(repeated))}) end at rows of their own, so that it cannot be "
            "read in parts; export it with one time column, or split it"
        )
    if parts == 1 or repeated:
        return _tables(whole, wanted)
    step = -(-size // parts)
    end = _line_end(text, begin + step)
    (first,) = _tables(replace(whole, text=replace(text, end=end)), wanted)
    later = partial(_parts, replace(whole, text=replace(text, notes=()), begin=end), step, wanted)
    return [replace(first, more=later, parts=parts)]


def _parts(rows: _Rows, step: int, wanted: Collection[str] | None) -> Iterator[LoggedTable]:
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


def _tables(rows: _Rows, wanted: Collection[str] | None) -> list[LoggedTable]:
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
        if widths != sorted(widths, reverse=True) or not _FEWEST_LINES <= whole < len(rows):
            return ""
        try:
            ends = [np.array(row[: widths[whole]], dtype=np.float64) for row in rows[whole - _FEWEST_LINES :]]
        except ValueError:
            return ""
        steps = np.abs(np.diff(ends[: _FEWEST_LINES + 1], axis=0))
        if (steps[-1] > LARGEST_STEP * steps[:-1].max(axis=0) + 1e-6 * np.abs(ends[_FEWEST_LINES - 1])).any():
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


@dataclass(frozen=True)
class Text:
    """A text as UTF-8."""

    file: Any  # A ``pyarrow.NativeFile``: the file itself, or its characters in memory
    start: int  # Byte where the text begins, after a byte order mark
    end: int  # Byte where its last whole line ends, without the line end
    notes: tuple[str, ...]  # What was left out, one sentence each
    quote: str | bool  # Quotation mark around cells; False without one


def open_text(source: FileSource, encoding: str) -> Text:
    """Open a text up to its last whole line.

    A last line without a line end is left out, because its last number may be cut off. Zero bytes that a logger leaves
    when it loses power are left out, too. ``notes`` reports both. ``auto`` takes the encoding from the byte order mark;
    without one it is UTF-8, or cp1252 if the beginning is not UTF-8.

    Raises:
        RecordingError: The bytes are not text in that encoding, or there is no whole line.
    """
    mark = next((mark for mark in BYTE_ORDER_MARKS if source.head.startswith(mark)), b"")
    if encoding == "auto":
        encoding = BYTE_ORDER_MARKS.get(mark, "utf-8")
        try:
            codecs.getincrementaldecoder(encoding)().decode(source.head, final=len(source.head) >= source.size)
        except UnicodeDecodeError:
            encoding = encoding if mark else "cp1252"
    start = len(codecs.BOM_UTF8) if mark == codecs.BOM_UTF8 else 0
    if codecs.lookup(encoding).name in ("utf-8", "utf-8-sig", "ascii"):
        if not isinstance(source.origin, bytes) and source.size > _READ_AT_ONCE:
            return _ended(pa.OSFile(str(source.origin)), start, '"')
        return _ended_in_memory(source.all_bytes, start)
    if source.size > MOST_INDIVISIBLE:
        raise RecordingError(
            f"its characters are {encoding} and it has {source.size / 1e6:.0f} MB; only UTF-8 is read in parts, other "
            f"text whole, up to {MOST_INDIVISIBLE / 1e6:.0f} MB; save it as UTF-8, or split it"
        )
    try:
        text = source.all_bytes.decode(encoding, errors="replace" if encoding == "cp1252" else "strict")
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"its characters are not {encoding}: {error.reason} at position {error.start}; name the right encoding, or "
            "leave it to be found out (auto)"
        ) from None
    return _ended_in_memory(text.removeprefix("\ufeff").encode(errors="replace"), 0)


def _ended_in_memory(content: bytes, start: int) -> Text:
    return _ended(pa.BufferReader(content), start, '"' if b'"' in content else False)


def _ended(file: Any, start: int, quote: str | bool) -> Text:
    notes: list[str] = []
    size, length = file.size(), _TAIL
    while True:
        begin = max(start, size - length)
        tail: bytes = file.read_at(size - begin, begin)
        body = tail.rstrip(b"\0\x1a")
        if begin == start or b"\n" in body or b"\r" in body:
            break
        length *= 16
    if (zeros := len(tail) - len(body)) > 1:
        notes.append(f"{zeros} zero bytes at its end were left out, as a logger leaves them that loses power")
    if body.rstrip(b' \t\n\r\f\v;,|"').endswith(b"EOF") and (match := _EOF.search(body)):
        body = body[: match.start()]  # a last line that only marks the end, perhaps in every cell
    whole = max(body.rfind(b"\n"), body.rfind(b"\r")) + 1
    if 0 < whole < len(body):
        cut = body[whole:][:80].decode(errors="replace")
        notes.append(f"its last line has no line end and may be cut in a number; it was left out: {cut!r}")
    end = begin + len(body[:whole].rstrip(b"\r\n"))
    if end <= start:
        raise RecordingError(
            "holds not one whole line; expected a line of names and one line per sample, each with its end"
        )
    return Text(file, start, end, tuple(notes), quote)


_KEY = re.compile(
    r"(?:(?:test|log|logging|recording|measurement|acquisition|mess|aufnahme|aufzeichnungs)?"
    r"(?:start|begin|beginn|date|datum|time|zeit|uhrzeit|timestamp|(?:start|date)(?:date|time|timestamp|zeit|datum)))"
    r"|started|recorded(?:at)?"
)
"""Words before a start in a header, in lower case, letters only."""
_LINE = re.compile(r"^[\s#%;\"*/]*([^\W\d][^\d:=;,\t]*?)[\s\"]*[:=;,\t](.*)$")
_DATE, _CLOCK = re.compile(rf"(?<!\d){DATE}(?!\d)"), re.compile(rf"(?<!\d){CLOCK}(?: ?UTC)?")


def start_in_header(lines: list[str], delimiter: str) -> Start | None:
    """Read the start in the lines above a text table's rows; None without an unambiguous date.

    It reads the FILETIME of the TwinCAT Scope, lines such as ``Start time: 2026-03-27 10:15:00``, and a date and a time
    of day on separate lines.
    """
    date = clock = None
    where = ""
    for line in lines:
        cells = line.split(delimiter) if delimiter != "whitespace" else [line]
        if cells[0].strip().casefold() == "starttime of export" and len(cells) > 1 and cells[1].strip().isdecimal():
            return Start(FILETIME.stamps(np.array([int(cells[1])]))[0], True, "FILETIME of the header")
        found = _LINE.match(line.rstrip())
        if found is None or not _KEY.fullmatch(re.sub(r"[\W_]", "", found[1]).casefold()):
            continue
        if date is None and (date := _DATE.search(found[2])):
            where = f"header line {line.strip()[:60]!r}"
        clock = clock or _CLOCK.search(found[2])
    if date is None:
        return None
    stamp = f"{date[0]} {clock[0].replace('UTC', 'Z')}" if clock else date[0]
    try:
        dates = dates_of(pa.array([stamp]), where)
    except RecordingError:  # the day or the month may come first
        return None
    if dates is None:
        return None
    if clock is None:
        return Start(dates.values[0].astype("datetime64[D]"), False, f"{where}, a date without a time of day")
    return Start(dates.values[0], dates.utc, where)


def split_groups(columns: list[Column], units: dict[str, str], repeated: Collection[str]) -> list[LoggedTable]:
    """Make a table ``group 1``, ... for each time column of a ``repeated`` name; without one, make a single table.

    A group ends with its last row that is not empty.
    """
    names = [name for name, _ in columns]
    clock = next((name for name in names if name in repeated and _are_clocks(columns, name)), None)
    if clock is None:
        return [LoggedTable(named_columns(columns), units)]
    starts = [index for index, name in enumerate(names) if name == clock]
    bounds = [0, *starts[1:], len(columns)]
    frames = [named_columns(columns[start:end]) for start, end in pairwise(bounds)]
    filled = [frame[frame.notna().any(axis=1)].reset_index(drop=True) for frame in frames]
    return [LoggedTable(frame, units, f"group {number}") for number, frame in enumerate(filled, start=1) if len(frame)]


def _are_clocks(columns: list[Column], name: str) -> bool:
    """Check whether all columns of a name have rising stamps, or are empty because their channels have no samples."""
    found = [values for other, values in columns if other == name and not pd.isna(values).all()]
    return bool(found) and all(values.dtype.kind in "iufM" and way_of(values) == 1 for values in found)


FORMAT = Format("csv", "a text table", read_delimited, ("csv", "rows"))
"""Any text table."""
