"""How a text table is laid out: what separates its cells, where its names stand, where its rows begin.

A user may state it; by default everything is detected.
"""

import codecs
from collections import Counter, deque
from dataclasses import dataclass
from functools import cache

from cylinder_friction.recordings.formats.cells import is_missing, is_number, is_value, split_cells
from cylinder_friction.recordings.formats.clocks import padded
from cylinder_friction.recordings.formats.header import read_header
from cylinder_friction.recordings.recording import RecordingError, expect

HEADERS = ("auto", "none", "names", "names_units")


@dataclass(frozen=True)
class CsvOptions:
    """How a text file is to be read."""

    delimiter: str = "auto"  # Between two values: one character, ``whitespace`` (runs of blanks and tabs), or ``auto``
    decimal: str = "auto"  # The decimal sign, ``.`` or ``,``, or ``auto``
    encoding: str = "auto"  # Of the characters, for example ``utf-8`` or ``cp1252``, or ``auto``
    # ``none`` (channels are then named column_1, column_2, ...), ``names`` (one line of names), ``names_units`` (a line
    # of names and a line of units right above the rows), or ``auto``, which finds them
    header: str = "auto"

    def __post_init__(self) -> None:
        one = self.delimiter in ("auto", "whitespace") or (len(self.delimiter) == 1 and self.delimiter not in '\r\n"')
        expect(one, "delimiter", "one character, 'whitespace' or 'auto'", self.delimiter)
        expect(self.decimal in ("auto", ".", ","), "decimal", "'.', ',' or 'auto'", self.decimal)
        expect(self.header in HEADERS, "header", f"one of {', '.join(HEADERS)}", self.header)
        try:
            codecs.lookup("utf-8" if self.encoding == "auto" else self.encoding)
        except LookupError:
            expect(False, "encoding", "one that Python knows, such as utf-8 or cp1252, or 'auto'", self.encoding)


AUTOMATIC = CsvOptions()

DELIMITERS = ("\t", ";", ",", "|", "whitespace")
MOST_COLUMNS = 10_000  # Of a text table
LOOKED_AT = 100
_LEAST_SCORE = 0.3


@dataclass(frozen=True)
class Layout:
    """Of a text table."""

    delimiter: str  # One character or ``whitespace``
    decimal: str | None  # ``.`` or ``,``; None if the rows looked at hold whole numbers only
    names: list[str]  # '' for a last column that only a delimiter at the end of each row makes
    units: dict[str, str]  # By name
    first_row: int  # Lines above the first row


@dataclass(frozen=True)
class _Grid:
    """The lines looked at, split by one delimiter."""

    delimiter: str
    decimal: str | None
    rows: list[list[str]]
    width: int
    numeric: list[int]
    score: float

    def is_row(self, cells: list[str]) -> bool:
        """Return whether every numeric column holds a value or nothing, and at least one holds a value."""
        if len(cells) != self.width:
            return False
        values = sum(is_value(cells[index], self.decimal) for index in self.numeric)
        missing = sum(is_missing(cells[index]) for index in self.numeric)
        return values > 0 and values + missing == len(self.numeric)


@dataclass(frozen=True)
class _Found:
    """A layout, and the lines above the rows of the file that it was found in."""

    options: CsvOptions
    head: list[str]
    layout: Layout

    def fits(self, lines: list[str], options: CsvOptions) -> bool:
        """Return whether a file has the same head, and rows of as many cells with no other decimal sign."""
        rows, layout = "".join(lines[len(self.head) :][:LOOKED_AT]), self.layout
        count = rows.count("\n")
        if options != self.options or lines[: len(self.head)] != self.head or not self.head or count < LOOKED_AT // 2:
            return False
        signs = {",", "."} - {layout.delimiter, layout.decimal}
        width = len(layout.names) - 1
        return (
            layout.delimiter != "whitespace"
            and not any(sign in rows for sign in (*signs, '"'))
            and all(line.count(layout.delimiter) == width for line in rows.splitlines())
        )


_FOUND: deque[_Found] = deque(maxlen=8)
"""Layouts found last: thousands of logs are mostly of one logger."""


def find_layout(lines: list[str], options: CsvOptions) -> Layout:
    """Return the layout of a table from its first whole lines; refuse lines with no layout, or with two.

    It may be that of an earlier file with the same head, with which ``LOOKED_AT`` rows are compared.
    """
    layout = next((found.layout for found in _FOUND if found.fits(lines, options)), None)
    if layout is None:
        layout = _found_layout(lines, options)
        _FOUND.appendleft(_Found(options, lines[: layout.first_row], layout))
    return layout


def _found_layout(lines: list[str], options: CsvOptions) -> Layout:
    content = [index for index, line in enumerate(lines) if line.strip()]
    stated = "whitespace" if options.delimiter == " " else options.delimiter
    delimiters = DELIMITERS if stated == "auto" else (stated,)
    lines = padded(lines, delimiters)
    decimal = None if options.decimal == "auto" else options.decimal
    # Of delimiters that occur in no line all make the same grid, of one column.
    looked_at = "\n".join(lines[index] for index in content[-LOOKED_AT:])
    absent = [each for each in delimiters if each != "whitespace" and each not in looked_at]
    tried = [each for each in delimiters if each not in absent[1:]]
    grids = [grid for delimiter in tried if (grid := _grid(lines, content, delimiter, decimal)) is not None]
    if not grids:
        raise RecordingError(
            f"no rows of numbers were found in its first {len(content)} lines; expected a table: a line of names and "
            "one line per sample; name the delimiter and the decimal sign if they are unusual"
        )
    grid = max(grids, key=lambda grid: _likelihood(grid, [lines[index] for index in content]))
    first = _first_row(grid, lines, content, options.header)
    trailing = grid.width > 1 and not any(row[-1] for row in grid.rows if len(row) == grid.width)
    names, units = read_header(lines[:first], grid.delimiter, grid.width, trailing, options.header)
    settled = decimal or _decimal([split_cells(line, grid.delimiter) for line in lines[first:][:LOOKED_AT]], grid)
    return Layout(grid.delimiter, settled, names, units, first)


def _grid(lines: list[str], content: list[int], delimiter: str, decimal: str | None) -> _Grid | None:
    """Split the last lines into cells. Return None if no column holds numbers or dates."""
    decimal = "." if delimiter == "," and decimal is None else decimal
    rows = [split_cells(lines[index], delimiter) for index in content[-LOOKED_AT:]]
    if not rows:
        return None
    # The later of two equally common widths: a header is above the rows.
    counts = Counter(len(row) for row in reversed(rows))
    width, _ = counts.most_common(1)[0]
    if width > MOST_COLUMNS:
        raise RecordingError(
            f"has {width:,} columns, expected at most {MOST_COLUMNS:,}; export the channels of the cylinder alone"
        )
    full = [row for row in rows if len(row) == width]
    # A short file is half header.
    lower = full[len(full) // 2 :]
    values = [sum(is_value(cell, decimal) for cell in column) for column in zip(*lower, strict=True)]
    missing = [sum(map(is_missing, column)) for column in zip(*lower, strict=True)]
    filled = [sum(counts) for counts in zip(values, missing, strict=True)]
    numeric = [index for index in range(width) if values[index] and 2 * filled[index] >= len(lower)]
    score = sum(filled) / width / len(lower) * len(full) / len(rows)
    return _Grid(delimiter, decimal, rows, width, numeric, score) if numeric else None


def _likelihood(grid: _Grid, lines: list[str]) -> tuple[bool, bool, bool, float, int]:
    """Return a key that ranks the ways to split a file's lines.

    First whether a line of names, or the first row, has as many cells as the rows: 3,845 below one name is a number
    with a decimal comma, below two names it is two. Then the share of cells that are numbers or dates.
    """
    if grid.width == 1:
        fits = not any(sign in lines[0] for sign in "\t;,|")
    else:
        cells = [split_cells(line.lstrip("#% "), grid.delimiter) for line in lines[:LOOKED_AT]]
        names = [row for row in cells if row[-1:] != [""] and not any(is_number(cell, None) for cell in row)]
        trailing = not grid.rows[-1][-1]
        fits = grid.is_row(cells[0]) or any(len(row) in (grid.width, grid.width - trailing) for row in names)
    return grid.score >= _LEAST_SCORE, fits, grid.width > 1, round(grid.score, 2), grid.width


def _first_row(grid: _Grid, lines: list[str], content: list[int], header: str) -> int:
    """Return the index of the first row's line; ``content`` holds those of the lines that are not empty."""

    @cache
    def is_row(position: int) -> bool:
        return grid.is_row(split_cells(lines[content[position]], grid.delimiter))

    if header != "auto":
        below = [index for index in content if not lines[index].lstrip().startswith(("#", "%", "//"))]
        skipped = ("none", "names", "names_units").index(header)
        if len(below) <= skipped:
            raise RecordingError(f"holds {len(below)} lines, but its header alone takes {skipped}; there are no rows")
        if header != "names_units" or is_row(content.index(below[skipped])):  # otherwise there is more above
            return below[skipped]

    for first in range(len(content)):
        # A line of the preamble may look like a row; most lines after it then do not. A row may be damaged.
        after = range(first + 1, min(first + 11, len(content)))
        if is_row(first) and 2 * sum(map(is_row, after)) >= len(after):
            break
    else:
        raise RecordingError("no row of numbers was found below its header; expected one line per sample")
    # Rows in which a sensor reads 'overload' come before: they are no header, for their first number, time, is there.
    while first > 0:
        cells = split_cells(lines[content[first - 1]], grid.delimiter)
        if len(cells) != grid.width or not is_value(cells[grid.numeric[0]], grid.decimal):
            break
        first -= 1
    return content[first]


def _decimal(rows: list[list[str]], grid: _Grid) -> str | None:
    """Return the decimal sign that these rows show; None if they hold whole numbers only."""
    cells = [row[index] for row in rows if len(row) == grid.width for index in grid.numeric]
    points = sum("." in cell and is_number(cell, ".") for cell in cells)
    commas = sum("," in cell and is_number(cell, ",") for cell in cells) if grid.delimiter != "," else 0
    return None if not points and not commas else "," if commas > points else "."
