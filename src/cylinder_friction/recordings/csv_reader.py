"""Comma-separated values, as loggers and spreadsheets write them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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
    """

    delimiter: str = ","
    decimal: str = "."

    def read(self, path: Path) -> pd.DataFrame:
        """Returns the channels as the file names them, one row a line; an empty field is NaN.

        Raises:
            RecordingError: The file is not such a table: empty, not UTF-8, or a line with more or fewer values
                than the header.
        """
        try:
            table = pa_csv.read_csv(
                path,
                read_options=pa_csv.ReadOptions(use_threads=False),
                parse_options=pa_csv.ParseOptions(delimiter=self.delimiter),
                convert_options=pa_csv.ConvertOptions(decimal_point=self.decimal, strings_can_be_null=True),
            )
        except (pa.ArrowInvalid, UnicodeDecodeError) as error:
            raise RecordingError(
                f"cannot be read as CSV with delimiter {self.delimiter!r}: {error}; expected one header line and as "
                "many values in every line; an interrupted log ends in half a line: cut it off"
            ) from None
        channels = pd.concat([column.to_pandas() for column in table.columns], axis=1)
        channels.columns = pd.Index([name.strip() for name in table.column_names])
        return channels
