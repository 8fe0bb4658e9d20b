from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError


def times(folder: Path, cells: list[str]):  # type: ignore[no-untyped-def]
    path = folder / "log.csv"
    path.write_text("Zeit;p\n" + "".join(f"{cell};{row}\n" for row, cell in enumerate(cells)), encoding="utf-8")
    (table,) = read_logged_file(path)
    return table


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["2026-03-14T08:15:00.125", "2026-03-14T08:15:01"], ["2026-03-14T08:15:00.125", "2026-03-14T08:15:01"]),
        (["2026-03-14 08:15:00,125", "2026-03-14 08:15:01"], ["2026-03-14T08:15:00.125", "2026-03-14T08:15:01"]),
        (["14.03.2026 08:15:00,125", "14.03.2026 08:15:00,13"], ["2026-03-14T08:15:00.125", "2026-03-14T08:15:00.130"]),
        (["01.02.2026 08:15", "1.2.2026 08:16"], ["2026-02-01T08:15", "2026-02-01T08:16"]),
        (["2026/03/14 08:15:00:005", "2026/03/14 08:15:01"], ["2026-03-14T08:15:00.005", "2026-03-14T08:15:01"]),
        (["14-Mar-2026 08:15:00", "14-Mar-2026 08:15:01"], ["2026-03-14T08:15:00", "2026-03-14T08:15:01"]),
        (["14-Mar-26 08:15:00", "14-Mar-26 08:15:01"], ["2026-03-14T08:15:00", "2026-03-14T08:15:01"]),
        (["03/14/2026 12:00:00 AM", "03/14/2026 1:00:00 PM"], ["2026-03-14T00:00:00", "2026-03-14T13:00:00"]),
        (["2026-03-14T08:15:00+01:00", "2026-03-14T08:15:01+01:00"], ["2026-03-14T07:15:00", "2026-03-14T07:15:01"]),
        (["14.03.2026 08:15:00+01:00", "14.03.2026 08:15:01Z"], ["2026-03-14T07:15:00", "2026-03-14T08:15:01"]),
        (["2026-03-14", "2026-03-15"], ["2026-03-14", "2026-03-15"]),
        (["14.03.2026 08:15:00", "NaN", "14.03.2026 08:15"], ["2026-03-14T08:15:00", "NaT", "2026-03-14T08:15"]),
        (["28/02/2026 23:59:59", "01/03/2026 00:00:00"], ["2026-02-28T23:59:59", "2026-03-01T00:00:00"]),
        (["02/28/2026 23:59:59", "03/01/2026 00:00:00"], ["2026-02-28T23:59:59", "2026-03-01T00:00:00"]),
    ],
)
def test_dates(tmp_path: Path, cells: list[str], expected: list[str]) -> None:
    stamps = times(tmp_path, cells).channels["Zeit"].to_numpy()
    assert stamps.dtype == np.dtype("datetime64[ns]")
    np.testing.assert_array_equal(stamps, np.array(expected, dtype="datetime64[ns]"))


def test_day_and_month_are_never_guessed(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"channel 'Zeit': '01/02/2026 08:00:00' may have the day or the month"):
        times(tmp_path, ["01/02/2026 08:00:00", "01/02/2026 08:00:01"])


@pytest.mark.parametrize(
    ("cells", "unit", "expected"),
    [
        (["08:15:00,125", "08:15:00,130"], "s", [29700.125, 29700.13]),
        (["08:15:00", "08:15:01"], "s", [29700.0, 29701.0]),
        (["08:15:00.5 PM", "12:15:00 am"], "s", [72900.5, 900.0]),
        (["15:00.1", "15:00.2"], "s", [900.1, 900.2]),
        (["0 sec", "0.005 sec"], "sec", [0.0, 0.005]),
        (["0ms", "5ms"], "ms", [0.0, 5.0]),
    ],
)
def test_a_time_of_day_counts_from_midnight(tmp_path: Path, cells: list[str], unit: str, expected: list[float]) -> None:
    """A duration states its own unit."""
    table = times(tmp_path, cells)
    assert table.units == {"Zeit": unit}
    np.testing.assert_allclose(table.channels["Zeit"], expected, rtol=1e-15)


@pytest.mark.parametrize(
    "cell", ["31.02.2026 08:15:00", "14.13.2026 08:15:00", "14.03.2026 25:15:00", "14.03.0026 08:15:00"]
)
def test_what_is_no_date_stays_text(tmp_path: Path, cell: str) -> None:
    assert times(tmp_path, ["14.03.2026 08:15:00", cell]).channels["Zeit"].tolist() == ["14.03.2026 08:15:00", cell]
