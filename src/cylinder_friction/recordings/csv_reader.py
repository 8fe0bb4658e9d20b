"""Comma-separated values, as loggers and spreadsheets write them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class CsvReader:
    """Reads one header line of channel names and one line a sample.

    Attributes:
        delimiter: Between two values.
        decimal: The decimal sign, ``.`` or ``,``.
        encoding: Of the characters, for example ``utf-8`` or ``latin-1``.
    """

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"

    def read(self, path: Path) -> pd.DataFrame:
        """Returns the channels as the file names them, one row a line; an empty field is NaN.

        Raises:
            RecordingError: The file is not such a table: empty, in another encoding, a line with more or fewer
                values than the header, or a last line without its end, whose last number may be cut.
        """
        _refuse_open_end(path)
        try:
            table = pa_csv.read_csv(
                path,
                read_options=pa_csv.ReadOptions(use_threads=False, encoding=self.encoding),
                parse_options=pa_csv.ParseOptions(delimiter=self.delimiter),
                convert_options=pa_csv.ConvertOptions(decimal_point=self.decimal, strings_can_be_null=True),
            )
            names = [name.strip() for name in table.column_names]
            columns = [self._numbers(table.column(index).to_pandas()) for index in range(table.num_columns)]
        except (pa.ArrowInvalid, UnicodeDecodeError, LookupError) as error:
            raise RecordingError(
                f"cannot be read as CSV with delimiter {self.delimiter!r} and encoding {self.encoding!r}: {error}; "
                "expected one header line and as many values in every line"
            ) from None
        channels = pd.concat(columns, axis=1)
        channels.columns = pd.Index(names)
        return channels

    def _numbers(self, column: pd.Series[Any]) -> pd.Series[Any]:
        """Returns a column that holds text with its numbers read all the same, so that only what is none is text.

        Under a decimal comma a point is no decimal sign: such a cell stays text, for it may be a thousands separator.
        """
        if self.decimal == "." or pd.api.types.is_numeric_dtype(column):
            return column
        text = column.astype("string")
        plain = text.where(~text.str.contains(".", regex=False, na=False))
        numbers = pd.to_numeric(plain.str.replace(self.decimal, ".", regex=False), errors="coerce")
        cells = [f"'{cell}'" for cell in column]
        return numbers.astype(object).where(numbers.notna() | column.isna(), pd.Series(cells, dtype=object))


def _refuse_open_end(path: Path) -> None:
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(size - 1, 0))
        if size and file.read(1) not in b"\r\n":
            raise RecordingError(
                "its last line has no line end, so the log may have been cut in the middle of a number; cut that line "
                "off, or add the line end if the line is whole"
            )
