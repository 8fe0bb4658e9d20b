"""Read text tables separated by comma, semicolon, tab or blanks, with any lines of a logger above them."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv

from cylinder_friction.recordings.formats.cells import (
    MISSING,
    columns_of,
    is_missing,
    is_number,
    is_value,
    names_to_read,
    on_its_day,
    start_in_header,
    way_of,
)
from cylinder_friction.recordings.formats.format import (
    AUTOMATIC,
    HEAD_SIZE,
    MOST_INDIVISIBLE,
    Column,
    CsvOptions,
    FileSource,
    Format,
    LoggedTable,
    Text,
    named_columns,
    open_text,
)
from cylinder_friction.recordings.mapping.channel_mapping import KNOWN, SCALED, unit_in_name
from cylinder_friction.recordings.recording import RecordingError, Start

DELIMITERS = ("\t", ";", ",", "|", "whitespace")
LOOKED_AT, _MOST_ABOVE = 40, 100
_LEAST_SCORE = 0.3
_FEWEST_LINES, _USUAL_LINES = 20, 500
_LARGEST_HEAD = 64 * HEAD_SIZE
_TOKEN = re.compile(r'"[^"]*"|\S+(?:[ \t]+(?:\[[^\]]*\]|\([^)]*\)))?')
_UNIT_WORD = re.compile("unit|einheit", re.IGNORECASE)
"""In the first cell of a line of units, such as 'Unit', 'Vertical Units', 'Y_Unit_Label'."""
_TYPE = re.compile(
    r"([fiu]|[usl]*(int|real)|float|double|bool|string|datetime)\d*(\(.*\))?|(type|unit|interp|\w+path): .*", re.I
)
"""What may be below a name: a type (``Float32``, ``f8``, ``LREAL``), or words of Simulink's Data Inspector."""
MOST_LINES, FEWEST_VALUES = 100, 1000  # Most lines of a table with a channel per line, and fewest cells of such a line
_FACTOR = re.compile(
    r"[#%\"\s]*(?:\w+: *)?(?:scal(?:e|ing)(?: ?factor)?|fa[ck]tor|gain|slope|multiplier)[\":= ]*(?=[,;\t|\d])",
    re.IGNORECASE,
)
"""What begins a line of factors above the rows. Vertical Scale of an oscilloscope is that of its display."""
_START = re.compile(r"x_?0|t_?0|x_?origin|offset|start(?:[ _]?time)?|time|.*\bdelay\b.*", re.IGNORECASE)
STEP_KEYS = ("delta_x", "hresolution")  # Words before a sample time [s], in lower case
SCOPE_TIME = "Name"  # Name that the TwinCAT Scope gives every time column


def read_delimited(
    source: FileSource, wanted: Collection[str] | None, csv: CsvOptions = AUTOMATIC, rows: int | None = None
) -> list[LoggedTable]:
    """Read the table of a text file: find the layout in its first lines, then parse the rows with Arrow in one pass.

    A file with several time columns of one name gives a table for each, with the channels after it. A file with many
    more than ``rows`` rows is read in equal parts of about ``rows`` whole lines, so that memory holds only one part.
    """
    text = open_text(source, csv.encoding)
    lines, layout = _first_lines(text, csv)
    above, below = lines[: layout.first_row], lines[layout.first_row :]
    begin = text.start + sum(map(len, above))
    header = [line.decode() for line in above]
    _refuse_stated(header, layout.delimiter)
    start, rate_hz = start_in_header(header), rate_in_header(header, layout.delimiter)
    row_size, size = max(1, sum(map(len, below)) // len(below)), text.end - begin
    parts, repeated = 1 if rows is None else max(1, round(size / row_size / rows)), repeated_names(layout.names)
    if parts > 1 and repeated and source.size > MOST_INDIVISIBLE:
        raise RecordingError(
            f"has columns of one name ({', '.join(sorted(repeated))}), which may end at rows of their own, and is then "
            f"read whole, up to {MOST_INDIVISIBLE / 1e6:.0f} MB; export it with one time column, or split it"
        )
    parts = 1 if repeated else parts
    step, bounds = -(-size // parts), [begin]
    while bounds[-1] < text.end:
        bounds.append(_line_end(text, bounds[-1] + step))
    whole, *later = (_Rows(text, layout, start, begin, *each) for each in pairwise(bounds))
    first, *others = whole.tables(wanted)
    dated = [str(name) for name, values in first.channels.items() if values.dtype.kind == "M"]
    more = (lambda: (replace(part, dated=dated).tables(wanted)[0] for part in later)) if later else None
    first = replace(first, notes=(*text.notes, *first.notes), more=more, parts=parts)
    return [replace(each, rate_hz=rate_hz) for each in (first, *others)]


def _refuse_stated(header: list[str], delimiter: str) -> None:
    """Refuse what lines above the rows state and reading would drop: factors other than 1, and starts that differ."""
    for line in header:
        name, *rest = split_cells(line, delimiter) or [""]
        own = {cell for cell in rest if cell}
        differ = len(own) > 1 and all(is_value(cell, None) for cell in own) and len({":" in cell for cell in own}) == 1
        if differ and _START.fullmatch(re.sub(r"[\[(].*", "", name).strip("#% ")):
            raise RecordingError(
                f"states different starts of its channels, {line.strip()[:80]!r}; expected one; write a time column "
                "for each channel, or cut all to a common start and take that line out"
            )
        named = _FACTOR.match(line)
        cells = re.findall(r"[-+\d.eE]*\d[\d.]*", line[named.end() :].replace(",", ";")) if named else []
        if any(is_number(cell, ".") and float(cell) != 1.0 for cell in cells):
            raise RecordingError(
                f"holds factors above its rows, {line.strip()[:80]!r}, and nothing shows whether the rows are already "
                "multiplied by them; multiply them if not, and take that line out"
            )


def rate_in_header(lines: list[str], delimiter: str) -> float | None:
    """Read the rate [Hz] of a header with one sample time for all channels, as LabVIEW and Yokogawa write it."""
    stated = (split_cells(line, delimiter)[1:] for line in lines if line.lstrip('" ').casefold().startswith(STEP_KEYS))
    steps_s = {float(cell.replace(",", ".")) for cells in stated for cell in cells if is_number(cell, None)}
    return 1.0 / steps_s.pop() if len(steps_s) == 1 and min(steps_s) > 0.0 else None


def _line_end(text: Text, place: int) -> int:
    """Find the byte after the line that contains ``place``, at most the end of the text."""
    while place < text.end:
        block = text.file.read_at(min(HEAD_SIZE, text.end - place), place)
        if (found := block.find(b"\n")) >= 0:
            return int(place + found + 1)
        place += len(block)
    return text.end


def _first_lines(text: Text, options: CsvOptions) -> tuple[list[bytes], Layout]:
    """Read enough of the first whole lines to contain names and rows, and find their layout."""
    length = text.end - text.start
    for size, most in ((HEAD_SIZE, _USUAL_LINES), (_LARGEST_HEAD, None)):  # the lines above the rows may be many
        head = text.file.read_at(min(size, length), text.start)
        lines: list[bytes] = head.splitlines(keepends=True)[: None if len(head) == length else -1]
        with suppress(RecordingError):
            if len(lines) > _FEWEST_LINES or len(head) == length:
                return lines, find_layout([line.decode() for line in lines[:most]], options)
    return lines, find_layout([line.decode() for line in lines], options)


@dataclass(frozen=True)
class _Rows:
    """The rows of a text table from byte ``begin`` to ``end``; errors name the line of a wrong row."""

    text: Text
    layout: Layout
    start: Start | None  # The start that the lines above the rows state
    first: int  # The byte where the first row of the table begins
    begin: int
    end: int
    dated: Collection[str] | None = None  # The columns of dates in the first part; None in that part

    def tables(self, wanted: Collection[str] | None) -> list[LoggedTable]:
        """Read the wanted columns, and those that may be time: one table, or one for each time column of one name."""
        names, units = self.layout.names, self.layout.units
        repeated, read = repeated_names(names), names_to_read(names, wanted)
        if not read:
            return [LoggedTable(pd.DataFrame(), units, unread=tuple(filter(None, names)))]
        loaded = [index for index, name in enumerate(names) if name in read | repeated]
        table = self._parsed(loaded, padded=bool(repeated) or names[0] == SCOPE_TIME)
        named = [(names[index], column) for index, column in zip(loaded, table.columns, strict=True)]
        found = on_its_day(columns_of(named, self.layout.decimal, wanted), self.start, self.dated)
        columns = [
            (name or f"column_{len(names)}", each) for name, each in found.columns if name or not pd.isna(each).all()
        ]
        first, *others = split_groups(columns, {**units, **found.units}, repeated)
        kept = {"", *first.channels, *(names if wanted is None else wanted)}
        unread = tuple(name for name in names if name not in kept)
        first = replace(first, unread=unread, notes=tuple(found.notes))
        return [replace(each, start=self.start, utc=found.utc) for each in (first, *others)]

    def _parsed(self, loaded: list[int], padded: bool) -> Any:
        """Parse the columns with these numbers as a ``pyarrow.Table``."""
        width = len(self.layout.names)
        delimiter = "\t" if self.layout.delimiter == "whitespace" else self.layout.delimiter
        names, included = [str(index) for index in range(width)], [str(index) for index in loaded]
        reading = pa_csv.ReadOptions(use_threads=False, column_names=names)
        parsing = pa_csv.ParseOptions(delimiter=delimiter, ignore_empty_lines=width > 1)
        cells = pa_csv.ConvertOptions(
            decimal_point=self.layout.decimal or ".",
            null_values=MISSING,
            strings_can_be_null=True,
            include_columns=included,
        )
        try:
            return pa_csv.read_csv(self._stream(padded), reading, parsing, cells)
        except pa.ArrowInvalid as error:
            self._refuse_ragged_line()
            raise RecordingError(f"cannot be read as a text table: {error}") from None

    def _stream(self, padded: bool) -> Any:
        length = self.end - self.begin
        if self.layout.delimiter != "whitespace":
            return pa.BufferReader(self._whole_rows()) if padded else self.text.file.get_stream(self.begin, length)
        lines = self.text.file.read_at(length, self.begin).splitlines()
        return pa.BufferReader(b"\n".join(b"\t".join(line.split()) for line in lines))

    def _whole_rows(self) -> bytes:
        """Pad every row to the number of names, because a channel of a scope may end before the others."""
        lines, delimiter = [line for _, line in self._lines()], self.layout.delimiter
        widths = [line.count(delimiter) for line in lines]
        if widths != sorted(widths, reverse=True):
            self._refuse_ragged_line()
        return "\n".join(_padded(line, delimiter, len(self.layout.names)) for line in lines).encode()

    def _lines(self) -> list[tuple[int, str]]:
        """List the rows that are not empty, each with its line number in the file, counted from 1."""
        read_at, places = self.text.file.read_at, range(self.first, self.begin, HEAD_SIZE)
        before = sum(read_at(min(HEAD_SIZE, self.begin - place), place).count(b"\n") for place in places)
        content = read_at(self.end - self.begin, self.begin).decode()
        lines = enumerate(re.split(r"\r\n|\n|\r", content), start=self.layout.first_row + before + 1)
        return [(number, line) for number, line in lines if line or len(self.layout.names) == 1]

    def _refuse_ragged_line(self) -> None:
        width = len(self.layout.names)
        for number, line in self._lines():
            if (count := len(split_cells(line, self.layout.delimiter))) != width:
                raise RecordingError(
                    f"line {number} holds {count} instead of {width} values: {line[:80]!r}; correct it, or cut the "
                    "file there if it holds two logs or segments (in LabVIEW, write one header only)"
                    + (", or export it separated by tab or semicolon" if self.layout.delimiter == "whitespace" else "")
                )


def split_groups(columns: list[Column], units: dict[str, str], repeated: Collection[str]) -> list[LoggedTable]:
    """Make a table ``group 1``, ... for each time column (rising, or empty) of a ``repeated`` name, or one table."""
    names = [name for name, _ in columns]
    found = {name: [own for other, own in columns if other == name and not pd.isna(own).all()] for name in repeated}
    ways = {name: {way_of(each) if each.dtype.kind in "iufM" else 0 for each in own} for name, own in found.items()}
    clock = next((name for name in names if ways.get(name) == {1}), None)
    if clock is None:
        return [LoggedTable(named_columns(columns), units)]
    starts = [index for index, name in enumerate(names) if name == clock]
    bounds = [0, *starts[1:], len(columns)]
    frames = [named_columns(columns[start:end]) for start, end in pairwise(bounds)]
    filled = [frame[frame.notna().any(axis=1)].reset_index(drop=True) for frame in frames]
    return [LoggedTable(frame, units, f"group {number}") for number, frame in enumerate(filled, start=1) if len(frame)]


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells without blanks and quotation marks; between blanks, a unit stays with its name."""
    line = line.rstrip("\r\n")
    if delimiter == "whitespace":
        return [token.strip('"') for token in _TOKEN.findall(line)]
    in_quotes = '"' in line and len(line) <= csv.field_size_limit()  # a longer field is an error in the module csv
    quoted = csv.reader([line], delimiter=delimiter, skipinitialspace=True) if in_quotes else ()
    return [cell.strip() for cell in next(iter(quoted), line.split(delimiter))]


@dataclass(frozen=True)
class Layout:
    """The layout of a text table."""

    delimiter: str  # One character or ``whitespace``
    decimal: str | None  # ``.`` or ``,``; None if the rows looked at have only whole numbers
    names: list[str]  # Names of the columns; '' for an empty last column after a delimiter at the end of each row
    units: dict[str, str]  # Units by name
    first_row: int  # Number of lines above the first row


@dataclass(frozen=True)
class _Grid:
    """The lines that are looked at, split by one delimiter."""

    delimiter: str
    decimal: str | None
    rows: list[list[str]]
    width: int
    numeric: list[int]
    score: float

    @cached_property
    def trailing(self) -> bool:
        """Whether every row ends with a delimiter; its last cell is then a channel only if it has a name."""
        return self.width > 1 and not any(row[-1] for row in self.rows if len(row) == self.width)

    @cached_property
    def numbered(self) -> bool:
        """Whether the first column counts the rows, as R writes it without a name."""
        counts = [row[0] for row in self.rows if len(row) == self.width]
        return len(counts) > 2 and all(one.isdecimal() and two == str(int(one) + 1) for one, two in pairwise(counts))

    def is_heading(self, cells: list[str]) -> bool:
        """Check whether a line has a cell for each column, lacks one without a name, or has LabVIEW's comments."""
        more = len(cells) - self.width
        comment = more == 1 and cells[-1].casefold() in ("", "comment")
        return more == 0 or comment or (more == -1 and (self.trailing or self.numbered))

    def is_row(self, cells: list[str]) -> bool:
        """Check whether every numeric column has a value or is empty, and at least one has a value."""
        if len(cells) != self.width:
            return False
        values = sum(is_value(cells[index], self.decimal) for index in self.numeric)
        missing = sum(is_missing(cells[index]) for index in self.numeric)
        return values > 0 and values + missing == len(self.numeric)


def find_layout(lines: list[str], options: CsvOptions) -> Layout:
    """Find the layout of a table in its first whole lines; refuse lines with no layout or an ambiguous one."""
    content = [index for index, line in enumerate(lines) if line.strip()]
    stated = "whitespace" if options.delimiter == " " else options.delimiter
    delimiters = DELIMITERS if stated == "auto" else (stated,)
    _refuse_line_per_channel([lines[index] for index in content], delimiters)
    lines = _rows_padded(lines, delimiters)
    decimal = None if options.decimal == "auto" else options.decimal
    looked_at = [lines[index] for index in content[-LOOKED_AT:]]
    # All delimiters that occur in no line give the same grid of one column.
    characters = set("".join(looked_at))
    absent = [each for each in delimiters if characters.isdisjoint(" \t" if each == "whitespace" else each)]
    tried = [each for each in delimiters if each not in absent[1:]]
    grids = [grid for delimiter in tried if (grid := _grid(looked_at, delimiter, decimal)) is not None]
    if not grids:
        raise RecordingError(
            f"no rows of numbers were found (lines searched: {len(content)}); expected a table: a line of names and "
            "one line per sample; state what is unusual in the mapping, such as csv: {delimiter: ',', decimal: ','}"
        )
    grid = max(grids, key=lambda grid: _likelihood(grid, [lines[index] for index in content]))
    first = _first_row(grid, lines, content)
    names, units = _names_and_units(lines[:first], grid, options.header)
    return Layout(grid.delimiter, decimal or _decimal(grid), names, units, first)


def _refuse_line_per_channel(lines: list[str], delimiters: Collection[str]) -> None:
    """Refuse a table that lies on its side: few lines, each a name and very many values."""
    for delimiter in delimiters if len(lines) <= MOST_LINES else ():
        rows = [split_cells(line, delimiter) for line in lines[-3:]]
        sideways = (len(row) >= FEWEST_VALUES and not is_value(row[0], None) for row in rows)
        if len(rows) > 1 and all(sideways) and all(is_value(cell, None) for row in rows for cell in row[-3:-1]):
            raise RecordingError(
                f"holds one line per channel, as {rows[-1][0]!r} with {len(rows[-1]) - 1} values; expected one column "
                "per channel and one line per sample; transpose it, in Python pandas.read_csv(..., header=None, "
                "index_col=0).T.to_csv('log.csv', index=False)"
            )


def _grid(lines: list[str], delimiter: str, decimal: str | None) -> _Grid | None:
    """Split lines into cells; None if no column has numbers or dates."""
    decimal = "." if delimiter == "," and decimal is None else decimal
    rows = [split_cells(line, delimiter) for line in lines]
    if not rows:
        return None
    # Of two equally common widths the later one is taken, because a header is above the rows.
    width, _ = Counter(len(row) for row in reversed(rows)).most_common(1)[0]
    full = [row for row in rows if len(row) == width]
    # The upper half of a short file may be its header.
    lower = full[len(full) // 2 :]
    values = [sum(is_value(cell, decimal) for cell in column) for column in zip(*lower, strict=True)]
    missing = [sum(map(is_missing, column)) for column in zip(*lower, strict=True)]
    filled = [sum(counts) for counts in zip(values, missing, strict=True)]
    numeric = [index for index in range(width) if values[index] and 2 * filled[index] >= len(lower)]
    if numeric[:1] == [1] and missing[0] == len(lower):  # what stands in an empty first column is the heading of a line
        numeric = [0, *numeric]
    score = sum(filled) / width / len(lower) * len(full) / len(rows)
    return _Grid(delimiter, decimal, rows, width, numeric, score) if numeric else None


def _likelihood(grid: _Grid, lines: list[str]) -> tuple[bool, bool, bool, float, int]:
    """Rank a way to split lines: whether names or the first row have as many cells, then the share of numbers."""
    if grid.width == 1:
        fits = not any(sign in lines[0] for sign in "\t;,|")
    else:
        cells = (split_cells(line.lstrip("#% "), grid.delimiter) for line in lines[:_MOST_ABOVE])
        names = (row for row in cells if row[-1:] != [""] and not any(is_number(cell, None) for cell in row))
        fits = any(map(grid.is_heading, names)) or grid.is_row(split_cells(lines[0].lstrip("#% "), grid.delimiter))
    return grid.score >= _LEAST_SCORE, fits, grid.width > 1, round(grid.score, 2), grid.width


def _first_row(grid: _Grid, lines: list[str], content: list[int]) -> int:
    """Find the line of the first row; ``content`` lists the lines that are not empty."""

    @cache
    def is_row(position: int) -> bool:
        return grid.is_row(split_cells(lines[content[position]], grid.delimiter))

    for first in range(len(content)):
        # A line of the preamble may look like a row, but most lines after it do not. Some rows may be damaged.
        after = range(first + 1, min(first + 11, len(content)))
        if is_row(first) and 2 * sum(map(is_row, after)) >= len(after):
            break
    else:
        raise RecordingError("no row of numbers was found below its header; expected one line per sample")
    # Include rows before it in which a sensor reads 'overload': they begin with a time, as no header does.
    while first > 0:
        cells = split_cells(lines[content[first - 1]], grid.delimiter)
        if len(cells) != grid.width or not is_value(cells[grid.numeric[0]], grid.decimal):
            break
        first -= 1
    return content[first]


def _decimal(grid: _Grid) -> str | None:
    """Find the decimal sign of a grid's rows; None if they have only whole numbers. Between commas it is a point."""
    if grid.delimiter == ",":
        return "."
    cells = [row[index] for row in grid.rows if len(row) == grid.width for index in grid.numeric]
    points, commas = (sum(sign in cell and is_number(cell, sign) for cell in cells) for sign in ".,")
    return None if not points and not commas else "," if commas > points else "."


def _units_in_line(cells: list[str]) -> list[str] | None:
    """Read the units of a line that consists mostly of units, '' for a cell without one; None for other lines."""
    units, others = [], 0
    for cell in cells:
        text = cell[1:-1].strip() if cell[:1] + cell[-1:] in ("[]", "()") else cell
        known = text.casefold().replace("deg ", "deg") in KNOWN or ((own := SCALED.search(text)) and own[0] == text)
        units.append(text if known or text != cell else "")
        others += bool(text) and not units[-1] and not _UNIT_WORD.search(text)
    return units if sum(map(bool, units)) > others else None


def _names_and_units(above: list[str], grid: _Grid, mode: str) -> tuple[list[str], dict[str, str]]:
    """Find channels and units in the lines above the first row; ``mode`` is ``CsvOptions.header``."""
    block: list[list[str]] = []
    for line in reversed([line for line in above if line.strip() and not line.startswith("***")]):
        comment = line.lstrip().startswith(("#", "%", "//"))
        cells = split_cells(line.lstrip("#%/ ") if comment else line, grid.delimiter)
        if grid.width > 1 and all(_TYPE.fullmatch(cell) for cell in cells if cell):
            continue
        if not grid.is_heading(cells) or (grid.width == 1 and block):
            break
        block.insert(0, cells)
    pairs = reversed(list(pairwise(block)))
    stated = ((names, units) for names, line in pairs if (units := _units_in_line(line)) and not _units_in_line(names))
    # If the line of units has a heading, such as Unit, the names may be below it, and other such lines around it.
    headings = (_units_in_line(line) for line in block if _UNIT_WORD.search(line[0]))
    headed = max(filter(None, headings), key=lambda units: sum(map(bool, units)), default=None)
    plain = [cells for cells in block if not _units_in_line(cells) and all(map(str.__ne__, cells, cells[1:]))]
    plain = [cells for cells in plain if not any(is_value(cell, None) for cell in cells)]
    labelled = (split_cells(line, grid.delimiter) for line in above if "Unit: " in line)
    told = [[cell.removeprefix("Unit: ") for cell in cells] for cells in labelled if grid.is_heading(cells)]
    if not block:
        cells, units = [], None
    elif told:
        cells, units = block[-1], told[0]
    elif scope := _scope_names(above, grid):
        cells, units = scope
    elif mode == "names_units" and len(block) > 1:
        cells, units = block[-2:]
    elif headed and plain:
        cells, units = plain[-1], headed
    else:
        cells, units = next(stated, (block[-1], None))
    unnamed = grid.numbered and not grid.trailing and len(cells) == grid.width - 1
    cells = [*[""] * unnamed, *cells, *[""] * grid.width][: grid.width]
    names = [name or f"column_{index}" for index, name in enumerate(cells, start=1)]
    if grid.trailing and not cells[-1]:
        names[-1] = ""
    of_names = {name: unit for name in names if (unit := unit_in_name(name)) is not None}
    return names, of_names | {name: unit for name, unit in zip(names, units or [], strict=False) if name and unit}


def _scope_names(above: list[str], grid: _Grid) -> tuple[list[str], list[str]] | None:
    """Find channels and units (``V (Voltage)``) of a TwinCAT Scope: ``Name;p1;p2;Name;x``, where Name is ms."""
    if not any("Starttime of export" in line for line in above):
        return None
    rows = [cells for line in above if len(cells := split_cells(line, grid.delimiter)) == grid.width]
    names = next((cells for cells in reversed(rows) if cells[0] == SCOPE_TIME), None)
    if names is None:
        return None
    stated = next((cells for cells in rows if cells[0] == "Unit"), [""] * grid.width)
    units = [cell.partition("(")[0].strip() for cell in stated]
    return names, ["ms" if name == SCOPE_TIME else unit for name, unit in zip(names, units, strict=True)]


def repeated_names(names: Sequence[str]) -> set[str]:
    """Find names that occur again after another column, because they may be time columns."""
    counts = Counter(names)
    adjacent = {one for one, other in pairwise(names) if one == other}
    return {name for name, count in counts.items() if name and count > 1} - adjacent


def _rows_padded(lines: list[str], delimiters: Collection[str]) -> list[str]:
    """Pad the rows below a line of repeated names to its number of cells; other lines stay as they are."""
    for number, line in enumerate(lines):
        if line[:1].isdecimal():  # a row, as most lines are
            continue
        for delimiter in delimiters:
            cells = split_cells(line, delimiter) if delimiter != "whitespace" else []
            if cells and cells[0] in repeated_names(cells) and not is_value(cells[0], None):
                below = [(row, next(filter(None, split_cells(row, delimiter)), "")) for row in lines[number:]]
                rows = (_padded(row, delimiter, len(cells)) if is_value(cell, None) else row for row, cell in below)
                return [*lines[:number], *rows]
    return lines


def _padded(line: str, delimiter: str, width: int) -> str:
    """Append empty cells up to ``width`` cells."""
    bare = line.rstrip("\r\n")
    return bare + delimiter * (width - 1 - bare.count(delimiter)) + line[len(bare) :]


FORMAT = Format("csv", "a text table", read_delimited, ("csv", "rows"))  # Any text table
