"""Detect the layout of a text table: its delimiter, its first row, and the names and units above the rows.

Units are stated with the names (``P1 [bar]``, ``P1 / bar``) or on a line of their own.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

from cylinder_friction.recordings.mapping.units import KNOWN, unit_in_name
from cylinder_friction.recordings.recording import RecordingError, expect

MISSING = (
    "", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "null", "NULL", "Null", "None", "-", "--", "---",
    "#N/A", "#NV", "nan(ind)", "-nan(ind)", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN", "EOF",
)  # fmt: skip
"""Cells of a missing sample. C libraries on Windows print NaN as ``1.#IND`` and the like. ``EOF`` is written below a
column that ends before others."""

OVER_RANGE = (
    "∞", "+∞", "-∞", "OL", "+OL", "-OL", "OVER", "+OVER", "-OVER", "Over", "OVERLOAD", "Overload", "overload",
    "OVERFLOW", "Overflow", "OVERRANGE", "Overrange", "+++++", "++++++", "-----", "------", "*****", "******",
)  # fmt: skip
"""Cells of a value beyond the range of the logger's input."""

POINT_NUMBER = r"[+-]? *(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
COMMA_NUMBER = r"[+-]? *(?:\d+,?\d*|,\d+)(?:[eE][+-]?\d+)?"

_MISSING_OR_OVER = frozenset((*MISSING, *OVER_RANGE))
_FORMS = {".": POINT_NUMBER, ",": COMMA_NUMBER, None: f"{POINT_NUMBER}|{COMMA_NUMBER}"}
_NUMBERS = {sign: re.compile(rf"{form}|[+-]?inf(?:inity)?", re.IGNORECASE) for sign, form in _FORMS.items()}
DATE = r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}-[A-Za-z]{3}-(?:\d{4}|\d{2}))"
CLOCK = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,:;]\d{1,9})?|[.,]\d{1,9})?(?: ?[AaPp][Mm])?(?: ?(?:Z|[+-]\d{2}:?\d{2}))?"
_DATE_OR_CLOCK = re.compile(rf"{DATE}(?:[T ,]+{CLOCK})?|{CLOCK}")
_TOKEN = re.compile(r'"[^"]*"|\S+(?:[ \t]+(?:\[[^\]]*\]|\([^)]*\)))?')


def is_missing(cell: str) -> bool:
    return cell in _MISSING_OR_OVER


def is_number(cell: str, decimal: str | None) -> bool:
    """Check whether a cell is a number with this decimal sign; None allows point and comma."""
    return bool(_NUMBERS[decimal].fullmatch(cell))


def is_value(cell: str, decimal: str | None) -> bool:
    """Check whether a cell is a number, a date or a time of day."""
    return bool(_NUMBERS[decimal].fullmatch(cell) or _DATE_OR_CLOCK.fullmatch(cell))


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells, and strip blanks and quotation marks.

    With the delimiter ``whitespace``, a unit in brackets stays with the name before it.
    """
    line = line.rstrip("\r\n")
    if delimiter == "whitespace":
        return [token.strip('"') for token in _TOKEN.findall(line)]
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error:
        return [cell.strip() for cell in line.split(delimiter)]


HEADERS = ("auto", "names_units")


@dataclass(frozen=True)
class CsvOptions:
    """Options for reading a text file; everything that is ``auto`` is detected."""

    delimiter: str = "auto"  # Delimiter of values: one character, ``whitespace`` (runs of blanks and tabs), or ``auto``
    decimal: str = "auto"  # Decimal sign: ``.``, ``,`` or ``auto``
    encoding: str = "auto"  # Character encoding, for example ``utf-8`` or ``cp1252``, or ``auto``
    # ``names_units`` (a line of names and a line of units are right above the rows), or ``auto``
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
MOST_COLUMNS = 10_000  # Most columns of a text table
LOOKED_AT = 100
_LEAST_SCORE = 0.3


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

    @property
    def trailing(self) -> bool:
        """Whether every row ends with a delimiter; its last cell is then a channel only if it has a name."""
        return self.width > 1 and not any(row[-1] for row in self.rows if len(row) == self.width)

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
    lines = padded(lines, delimiters)
    decimal = None if options.decimal == "auto" else options.decimal
    # All delimiters that occur in no line give the same grid of one column.
    looked_at = [lines[index] for index in content[-LOOKED_AT:]]
    characters = set("".join(looked_at))
    absent = [each for each in delimiters if characters.isdisjoint(" \t" if each == "whitespace" else each)]
    tried = [each for each in delimiters if each not in absent[1:]]
    grids = [grid for delimiter in tried if (grid := _grid(looked_at, delimiter, decimal)) is not None]
    if not grids:
        raise RecordingError(
            f"no rows of numbers were found in its first {len(content)} lines; expected a table: a line of names and "
            "one line per sample; name the delimiter and the decimal sign if they are unusual"
        )
    grid, *others = grids
    if others:
        grid = max(grids, key=lambda grid: _likelihood(grid, [lines[index] for index in content]))
    first = _first_row(grid, lines, content)
    names, units = _names_and_units(lines[:first], grid, options.header)
    return Layout(grid.delimiter, decimal or _decimal(grid), names, units, first)


def _grid(lines: list[str], delimiter: str, decimal: str | None) -> _Grid | None:
    """Split lines into cells; None if no column has numbers or dates."""
    decimal = "." if delimiter == "," and decimal is None else decimal
    rows = [split_cells(line, delimiter) for line in lines]
    if not rows:
        return None
    # Of two equally common widths the later one is taken, because a header is above the rows.
    width, _ = Counter(len(row) for row in reversed(rows)).most_common(1)[0]
    if width > MOST_COLUMNS:
        raise RecordingError(
            f"has {width:,} columns, expected at most {MOST_COLUMNS:,}; export the channels of the cylinder alone"
        )
    full = [row for row in rows if len(row) == width]
    # The upper half of a short file may be its header.
    lower = full[len(full) // 2 :]
    values = [sum(is_value(cell, decimal) for cell in column) for column in zip(*lower, strict=True)]
    missing = [sum(map(is_missing, column)) for column in zip(*lower, strict=True)]
    filled = [sum(counts) for counts in zip(values, missing, strict=True)]
    numeric = [index for index in range(width) if values[index] and 2 * filled[index] >= len(lower)]
    score = sum(filled) / width / len(lower) * len(full) / len(rows)
    return _Grid(delimiter, decimal, rows, width, numeric, score) if numeric else None


def _likelihood(grid: _Grid, lines: list[str]) -> tuple[bool, bool, bool, float, int]:
    """Return a key that ranks the ways to split a file's lines.

    The first criterion is whether a line of names, or the first row, has as many cells as the rows: 3,845 is one number
    with a decimal comma below one name, and two numbers below two names. The second is the share of numbers and dates.
    """
    if grid.width == 1:
        fits = not any(sign in lines[0] for sign in "\t;,|")
    else:
        cells = [split_cells(line.lstrip("#% "), grid.delimiter) for line in lines[:LOOKED_AT]]
        names = [row for row in cells if row[-1:] != [""] and not any(is_number(cell, None) for cell in row)]
        trailing = not grid.rows[-1][-1]
        fits = grid.is_row(cells[0]) or any(len(row) in (grid.width, grid.width - trailing) for row in names)
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
    """Find the decimal sign of a grid's rows; None if they have only whole numbers."""
    cells = [row[index] for row in grid.rows if len(row) == grid.width for index in grid.numeric]
    with_point = ("." in cell and is_number(cell, ".") for cell in cells)
    if grid.delimiter == ",":
        return "." if any(with_point) else None
    points, commas = sum(with_point), sum("," in cell and is_number(cell, ",") for cell in cells)
    return None if not points and not commas else "," if commas > points else "."


_DATE_PATTERN = re.compile(r"^(?=.*([dmyjths])\1)[dmyjths]+(?:[-/.:, ]+[dmyjthsfz0]+)+$", re.IGNORECASE)
"""Date formats in the place of a unit above dates: 'dd.mm.yyyy hh:mm:ss', 'TT.MM.JJJJ hh:mm'."""

_UNIT_WORDS = ("unit", "units", "einheit", "einheiten")
"""First cells of a line of units."""


def _units_in_line(cells: list[str]) -> list[str] | None:
    """Read the units of a line that consists mostly of units; None for another line.

    An empty cell, a cell without a unit (``NO.`` above row numbers), and a date format give the unit ''.
    """
    units, count = [], 0
    for cell in cells:
        bare = cell[1:-1].strip() if cell[:1] + cell[-1:] in ("[]", "()") else cell
        known = bare.casefold() in KNOWN
        if (_DATE_PATTERN.match(bare) and not known) or bare.casefold() in _UNIT_WORDS:
            bare = cell = ""
        count += bool(bare) and (known or bare != cell)
        units.append(bare if known or bare != cell else "")
    filled = sum(map(bool, cells)) - sum(cell.casefold() in _UNIT_WORDS for cell in cells)
    return units if count and 2 * count > filled - sum(map(bool, map(_DATE_PATTERN.match, cells))) else None


SCOPE_TIME = "Name"  # Name that the TwinCAT Scope gives every time column
_SCOPE_KEY = re.compile(
    r"symbol(comment|based|name)|data-type|sampletime\[ms\]|variablesize|index(group|offset)|netid|port|bitmask|"
    r"(unit )?(offset|scalefactor)|unit|(start|end)time"
)


def _names_and_units(above: list[str], grid: _Grid, mode: str) -> tuple[list[str], dict[str, str]]:
    """Find channels and their units in the lines above the first row; ``mode`` is ``CsvOptions.header``.

    A line of names has a cell for each column, or lacks the last one. An empty last column after a delimiter at the end
    of each row is named ''.
    """
    block: list[list[str]] = []
    for line in reversed([line for line in above if line.strip()]):
        comment = line.lstrip().startswith(("#", "%", "//"))
        cells = split_cells(line.lstrip("#%/ ") if comment else line, grid.delimiter)
        more = len(cells) - grid.width
        last = more == 1 and cells[-1].casefold() in ("", "comment")  # LabVIEW has a column of comments
        if not (more == 0 or last or (more == -1 and grid.trailing)) or (grid.width == 1 and block):
            break
        block.insert(0, cells)
    pairs = reversed(list(pairwise(block)))
    stated = ((names, units) for names, line in pairs if (units := _units_in_line(line)) and not _units_in_line(names))
    if not block:
        cells, units = [], None
    elif scope := _scope_names(above, grid):
        cells, units = scope
    elif mode == "names_units" and len(block) > 1:
        cells, units = block[-2:]
    else:
        cells, units = next(stated, (block[-1], None))
    cells = [*cells, *[""] * grid.width][: grid.width]
    names = [name or f"column_{index}" for index, name in enumerate(cells, start=1)]
    if grid.trailing and not cells[-1]:
        names[-1] = ""
    of_names = {name: unit for name in names if (unit := unit_in_name(name)) is not None}
    return names, of_names | {name: unit for name, unit in zip(names, units or [], strict=False) if name and unit}


def _scope_names(above: list[str], grid: _Grid) -> tuple[list[str], list[str] | None] | None:
    """Find the channels of a TwinCAT Scope and their units, which it writes as ``V (Voltage)``.

    The line of names is ``Name;Axis.Pos;Name;Axis.Vel``, or ``Name;p1;p2;Name;x`` if channels share a time column. Time
    is in ms. Lines such as SymbolName;...;SymbolName;... may follow.
    """
    found: dict[str, list[str]] = {}
    for cells in reversed([split_cells(line, grid.delimiter) for line in above]):
        key = cells[0].casefold() if len(cells) == grid.width else ""
        if key == "name":
            if not found and not any("Starttime of export" in line for line in above):
                return cells, None
            stated = [cell.partition("(")[0].strip() for cell in found.get("unit", [""] * len(cells))]
            return cells, ["ms" if name == SCOPE_TIME else unit for name, unit in zip(cells, stated, strict=True)]
        if _SCOPE_KEY.fullmatch(key):
            found[key] = cells
        elif key:
            break
    return None


def repeated_names(names: Sequence[str]) -> set[str]:
    """Find names that occur again after another column, because they may be time columns."""
    counts = Counter(names)
    adjacent = {one for one, other in pairwise(names) if one == other}
    return {name for name, count in counts.items() if name and count > 1} - adjacent


def padded(lines: list[str], delimiters: Collection[str]) -> list[str]:
    """Pad the rows below a line of repeated names to its number of cells."""
    for number, line in enumerate(lines):
        if line[:1].isdecimal():  # a row, as most lines are
            continue
        for delimiter in delimiters:
            cells = split_cells(line, delimiter) if delimiter != "whitespace" else []
            if cells and cells[0] in repeated_names(cells) and not is_value(cells[0], None):
                return [*lines[:number], *(_padded(below, delimiter, len(cells)) for below in lines[number:])]
    return lines


def _padded(line: str, delimiter: str, width: int) -> str:
    """Append empty cells to a row up to ``width`` cells; return any other line unchanged."""
    first = next((cell for cell in split_cells(line, delimiter) if cell), "")
    bare = line.rstrip("\r\n")
    return bare + delimiter * (width - 1 - bare.count(delimiter)) + line[len(bare) :] if is_value(first, None) else line
