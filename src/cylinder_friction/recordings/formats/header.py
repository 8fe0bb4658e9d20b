"""What stands above a text table's rows: names and units (``P1 [bar]``, ``P1 / bar``, or a line of their own)."""

import re

from cylinder_friction.recordings.formats.cells import is_number, split_cells
from cylinder_friction.recordings.mapping.units import ELECTRICAL, OTHER_QUANTITIES, USUAL
from cylinder_friction.recordings.recording import RecordingError

_RARE = "psig psia kg/cm² dm g mN uN μN uV μV MHz deg_c m/s² m/s^2 mm/s² g/s 1/s min-1 J ohm Ω m³/s cm³/s bit bits -"
_KNOWN = frozenset({*USUAL, *ELECTRICAL, *OTHER_QUANTITIES, *_RARE.casefold().split()})
"""Units in use, in small letters."""

_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[\s*(?P<unit>[^\[\]]*?)\s*\]$")
_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\(\s*(?P<unit>[^()]*?)\s*\)$")
_DIVIDED = re.compile(r"^(?P<name>\S+?\s*/\s*|.*\S (?:in|/) )(?P<unit>\S+)$")

_DATE_PATTERN = re.compile(r"^(?=.*([dmyjths])\1)[dmyjths]+(?:[-/.:, ]+[dmyjthsfz0]+)+$", re.IGNORECASE)
"""What stands in the place of a unit above dates: 'dd.mm.yyyy hh:mm:ss', 'TT.MM.JJJJ hh:mm'."""

_UNIT_WORDS = ("unit", "units", "einheit", "einheiten")
"""What stands before the units in a line of them."""

_PORTS = frozenset("abptxyckfgh")
"""Single letters in parentheses that name a port or an axis sooner than a unit: 'pressure (A)'."""


def looks_like_unit(text: str) -> bool:
    return text.casefold() in _KNOWN


def unit_in_name(name: str) -> str | None:
    """Return the unit that a header cell states, or None.

    What stands in square brackets is taken at its word, unless it is an index such as ``axis[1]``; what stands in
    parentheses or behind a stroke only if it is a unit in use, for it may be a remark.
    """
    match = _BRACKETS.match(name)
    if match and match["unit"] and not match["unit"].isdigit():
        return match["unit"]
    for pattern in (_PARENTHESES, _DIVIDED):
        match = pattern.match(name)
        if match and looks_like_unit(match["unit"]) and match["unit"].casefold() not in _PORTS:
            return match["unit"]
    return None


def units_in_line(cells: list[str]) -> list[str] | None:
    """Return the units of a line that holds mostly units; None for another line.

    A cell that is empty, no unit (``NO.`` above row numbers), or the format of the dates below it has the unit ''.
    """
    units, count = [], 0
    for cell in cells:
        bare = cell[1:-1].strip() if cell[:1] + cell[-1:] in ("[]", "()") else cell
        known = looks_like_unit(bare)
        if (_DATE_PATTERN.match(bare) and not known) or bare.casefold() in _UNIT_WORDS:
            bare = cell = ""
        count += bool(bare) and (known or bare != cell)
        units.append(bare if known or bare != cell else "")
    filled = sum(map(bool, cells)) - sum(cell.casefold() in _UNIT_WORDS for cell in cells)
    return units if count and 2 * count > filled - sum(map(bool, map(_DATE_PATTERN.match, cells))) else None


SCOPE_TIME = "Name"  # what the TwinCAT Scope calls every time column
_SCOPE_KEY = re.compile(
    r"symbol(comment|based|name)|data-type|sampletime\[ms\]|variablesize|index(group|offset)|netid|port|bitmask|"
    r"(unit )?(offset|scalefactor)|unit|(start|end)time"
)
_COMMENT = ("#", "%", "//", ";", "'")

Named = tuple[list[str], dict[str, str]]
"""Names of the columns, and units by name."""


def read_header(above: list[str], delimiter: str, width: int, trailing: bool, mode: str) -> Named:
    """Return what the lines above the first row, which has ``width`` cells, name: channels and their units.

    The name of a last column that only a delimiter at the end of each row makes is ''.

    Args:
        trailing: Every row ends in a delimiter, so that its last cell is no channel, unless it has a name.
        mode: ``CsvOptions.header``.

    Raises:
        RecordingError: The line of names has more or fewer cells than the rows.
    """
    if mode == "none":
        return _named([], None, width, trailing)
    block = _lines_of_cells(above, delimiter, width, trailing)
    units: list[str] | None = None
    if mode == "names_units" and len(block) > 1:
        *block, units = block
    if not block or (mode == "names_units" and units is None):
        _refuse_other_width(above, delimiter, width, always=mode != "auto")
        return _named([], None, width, trailing)
    if scope := _scope_lines(above, delimiter, width):
        return _named(scope["name"], _scope_units(scope, above), width, trailing)
    names = block[-1]
    if mode == "auto":
        for index in range(len(block) - 1, 0, -1):
            if units_in_line(block[index]) and not units_in_line(block[index - 1]):
                names, units = block[index - 1], units_in_line(block[index])
                break
    return _named(names, units, width, trailing)


def _lines_of_cells(above: list[str], delimiter: str, width: int, trailing: bool) -> list[list[str]]:
    """Return the unbroken run of lines right above the rows that have a cell for each column."""
    block: list[list[str]] = []
    for line in reversed([line for line in above if line.strip()]):
        cells = split_cells(line, delimiter)
        bare = split_cells(line.lstrip("#%/ "), delimiter)
        cells = bare if line.lstrip().startswith(("#", "%", "//")) else cells
        if not _fits(cells, width, trailing) or (width == 1 and block):
            break
        block.insert(0, cells)
    return block


def _fits(cells: list[str], width: int, trailing: bool) -> bool:
    """Compare a line's cells with the rows: either may lack the last one (a delimiter, LabVIEW's comment column)."""
    if len(cells) == width + 1:
        return cells[-1].casefold() in ("", "comment")
    return len(cells) == width or (trailing and len(cells) == width - 1)


def _refuse_other_width(above: list[str], delimiter: str, width: int, always: bool) -> None:
    """Refuse a line of names with too few or too many cells: the columns could not be identified."""
    number = max((index for index, line in enumerate(above, start=1) if line.strip()), default=0)
    if not number:
        return
    line = above[number - 1]
    cells = split_cells(line, delimiter)
    plain = not line.lstrip().startswith(_COMMENT) and ":" not in line and "=" not in line
    names = plain and len(cells) > max(1, width // 2) and not any(is_number(cell, None) for cell in cells)
    if names or always:
        raise RecordingError(
            f"line {number} names {len(cells)} channels, but the line below holds {width} values; "
            "expected a name for each value"
        )


def _scope_lines(above: list[str], delimiter: str, width: int) -> dict[str, list[str]]:
    """Return the lines in which the TwinCAT Scope describes its channels, by key; empty for other files.

    The line of names is ``Name;Axis.Pos;Name;Axis.Vel``, or ``Name;p1;p2;Name;x`` where channels share a time column.
    SymbolName;...;SymbolName;... and the like may follow below it.
    """
    found: dict[str, list[str]] = {}
    for cells in reversed([split_cells(line, delimiter) for line in above]):
        key = cells[0].casefold() if len(cells) == width else ""
        if key == "name":
            return {**found, key: cells}
        if _SCOPE_KEY.fullmatch(key):
            found[key] = cells
        elif key:
            break
    return {}


def _scope_units(found: dict[str, list[str]], above: list[str]) -> list[str] | None:
    """Return the units of a TwinCAT Scope's channels, which it writes as ``V (Voltage)``; its time is in ms."""
    names = found["name"]
    if len(found) == 1 and not any("Starttime of export" in line for line in above):
        return None
    stated = [cell.partition("(")[0].strip() for cell in found.get("unit", [""] * len(names))]
    return ["ms" if name == SCOPE_TIME else unit for name, unit in zip(names, stated, strict=True)]


def _named(cells: list[str], units: list[str] | None, width: int, trailing: bool) -> Named:
    padded = [*cells, *[""] * width][:width]
    names = [name or f"column_{index}" for index, name in enumerate(padded, start=1)]
    if trailing and not padded[-1]:
        names[-1] = ""
    found = {name: unit for name in names if (unit := unit_in_name(name)) is not None}
    if units is not None:
        found |= {name: unit for name, unit in zip(names, units, strict=False) if name and unit}
    return names, found
