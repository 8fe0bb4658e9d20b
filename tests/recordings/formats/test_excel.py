from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest

from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError


def saved(path: Path, **sheets: list[list[Any]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


ROWS = [[0.0, 1.5, 0.1], [0.005, 2.5, 0.2], [0.01, None, 0.3], [0.015, "#N/A", 0.4]]


def test_what_stands_above_the_names_and_a_line_of_units(tmp_path: Path) -> None:
    rows = [["Prüfstand"], [], ["Zeit", "Druck A", "Weg", None], ["[s]", "[bar]", "[m]"], *ROWS, [0.02, "1.007,5", 0.5]]
    (table,) = read_logged_file(saved(tmp_path / "log.xlsx", Daten=rows))
    assert table.units == {"Zeit": "s", "Druck A": "bar", "Weg": "m"}
    np.testing.assert_array_equal(table.channels["Druck A"], [1.5, 2.5, np.nan, np.nan, 1007.5])
    assert table.channels["Weg"].tolist() == [0.1, 0.2, 0.3, 0.4, 0.5]


def test_sheets_are_tables_and_one_without_rows_is_left_out(tmp_path: Path) -> None:
    fast = [["t", "p"], *([i, 2 * i] for i in range(6))]
    slow = [["t", "x"], *([datetime(2026, 3, 14, 8, 15) + timedelta(milliseconds=250 * i), i] for i in range(3))]
    path = saved(tmp_path / "log.xlsx", Info=[["Operator", "Zoë"]], Pressures=fast, Motion=slow)
    pressures, motion = read_logged_file(path)
    assert (pressures.name, motion.name) == ("Pressures", "Motion")
    assert (len(pressures.channels), len(motion.channels)) == (6, 3)
    assert motion.channels["t"].iloc[2] == np.datetime64("2026-03-14T08:15:00.500")
    with pytest.raises(RecordingError, match=r"sheet 'Info': no rows of numbers were found \(lines searched: 1\)"):
        read_logged_file(saved(path, Info=[["Operator", "Zoë"]]))
