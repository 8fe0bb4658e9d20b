"""Read Excel workbooks (.xlsx) with openpyxl; each sheet is read as if it had been saved as a text table."""

import re
from collections.abc import Collection
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

from cylinder_friction.recordings.formats.cells import COMMA_NUMBER
from cylinder_friction.recordings.formats.delimited import read_delimited
from cylinder_friction.recordings.formats.format import HEAD_SIZE, CsvOptions, FileSource, Format, LoggedTable
from cylinder_friction.recordings.recording import RecordingError

_AS_TEXT = CsvOptions(delimiter="\t", decimal=".", encoding="utf-8")


def read_excel(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Read a table per sheet that holds one, or per time column; of a formula its last value."""
    import openpyxl

    tables: list[LoggedTable] = []
    refusals: list[str] = []
    with source.opened() as opened:
        workbook = openpyxl.load_workbook(opened, read_only=True, data_only=True)
        for sheet in workbook.worksheets:
            try:
                found = read_delimited(_as_text(sheet), wanted, _AS_TEXT)
            except RecordingError as error:
                refusals.append(f"sheet {sheet.title!r}: {error}")
                continue
            title = f"{sheet.title} " if len(workbook.worksheets) > 1 else ""
            tables += [replace(table, name=f"{title}{table.name}".rstrip()) for table in found]
    if not tables:
        raise RecordingError(refusals[0] if refusals else "holds no sheet with cells; expected a table")
    return tables


def _as_text(sheet: Any) -> FileSource:
    sheet.reset_dimensions()  # some programs state too small a size
    rows = [cells for row in sheet.iter_rows(values_only=True) if any(cells := [_cell(value) for value in row])]
    width = max((number for row in rows for number, cell in enumerate(row, start=1) if cell), default=0)
    content = "".join("\t".join([*row, *[""] * width][:width]) + "\n" for row in rows).encode()
    return FileSource(content, content[:HEAD_SIZE], len(content))


def _cell(value: Any) -> str:
    if isinstance(value, str):
        text = " ".join(value.split())
        return text.replace(".", "").replace(",", ".") if re.fullmatch(COMMA_NUMBER, text) else text
    if isinstance(value, datetime):
        return value.isoformat(sep=" ")
    if isinstance(value, timedelta):
        return repr(value.total_seconds())
    return "" if value is None else str(int(value)) if isinstance(value, bool) else str(value)


FORMAT = Format(
    "excel",
    "an Excel workbook",
    read_excel,
    fits=lambda head: head.startswith(b"PK") and b"xl/" in head and b"xl/workbook.bin" not in head,
    library="openpyxl",
    crashes="the Excel library",
)
