"""What a single cell of a text table is: a number, a date, missing, or words."""

import csv
import re

MISSING = (
    "", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "null", "NULL", "Null", "None", "-", "--", "---",
    "#N/A", "#NV", "nan(ind)", "-nan(ind)", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN", "EOF",
)  # fmt: skip
"""What loggers write where a sample is missing; ``1.#IND`` and the like are what C libraries on Windows print for NaN,
``EOF`` stands below a column that ends before others."""

POINT_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
COMMA_NUMBER = r"[+-]?(?:\d+,?\d*|,\d+)(?:[eE][+-]?\d+)?"

_POINT = re.compile(rf"(?:{POINT_NUMBER}|[+-]?inf(?:inity)?)", re.IGNORECASE)
_COMMA = re.compile(rf"(?:{COMMA_NUMBER}|[+-]?inf(?:inity)?)", re.IGNORECASE)
_DATE = r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}-[A-Za-z]{3}-\d{4})"
_CLOCK = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,:]\d{1,9})?)?(?: ?[AaPp][Mm])?(?:Z|[+-]\d{2}:?\d{2})?"
_DATE_OR_CLOCK = re.compile(rf"{_DATE}(?:[T ,]+{_CLOCK})?|{_CLOCK}")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+")
_TOKEN = re.compile(r'"[^"]*"|\S+(?:[ \t]+(?:\[[^\]]*\]|\([^)]*\)))?')


def is_missing(cell: str) -> bool:
    return cell in MISSING


def is_number(cell: str, decimal: str | None) -> bool:
    """Return whether a cell is a number under a decimal sign; None stands for either."""
    return bool((decimal != "," and _POINT.fullmatch(cell)) or (decimal != "." and _COMMA.fullmatch(cell)))


def is_value(cell: str, decimal: str | None) -> bool:
    """Return whether a cell is a number, a date or a time of day."""
    return is_number(cell, decimal) or bool(_DATE_OR_CLOCK.fullmatch(cell))


def has_thousands(cell: str) -> bool:
    """Return whether the commas of a number could as well set off its thousands."""
    return bool(_THOUSANDS.fullmatch(cell))


def split_cells(line: str, delimiter: str) -> list[str]:
    """Return a line's cells without the blanks and the quotation marks around them.

    Under ``whitespace`` a unit in brackets stays with the name before it.
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
