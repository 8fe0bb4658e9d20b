from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError


def test_columns_of_every_kind(tmp_path: Path) -> None:
    table = pa.table(
        {
            "when": pa.array([0, 1_500], pa.timestamp("ms", tz="Europe/Berlin")),
            "day": pa.array([0, 1], pa.date32()),
            "count": pa.array([1, None], pa.int32()),
            "on": pa.array([True, False]),
            "state": pa.array(["up", None]).dictionary_encode(),
            " P1 ": pa.array([1.5, 2.5], pa.float32()),
            "list": pa.array([[1], [2]]),
        }
    )
    pq.write_table(table, tmp_path / "log")
    (read,) = read_logged_file(tmp_path / "log")
    assert read.unread == ("list",)
    stamps = np.array(["1970-01-01T00:00:00", "1970-01-01T00:00:01.5"], dtype="datetime64[ns]")
    np.testing.assert_array_equal(read.channels["when"].to_numpy(), stamps)
    assert read.channels["day"].dtype == np.dtype("datetime64[ns]")
    np.testing.assert_array_equal(read.channels["count"], [1.0, np.nan])
    assert read.channels["on"].tolist() == [1, 0]
    assert read.channels["state"].iloc[0] == "up"
    assert pd.isna(read.channels["state"].iloc[1])
    assert read.channels["P1"].dtype == np.float32


def test_row_numbers_of_pandas_are_no_channel_but_its_times_are(tmp_path: Path) -> None:
    path = tmp_path / "log"
    table = pd.DataFrame({"P1": [1.0, 2.0, 3.0]})
    table[table["P1"] > 1].to_parquet(path)
    assert list(read_logged_file(path)[0].channels.columns) == ["P1"]
    table.set_index(pd.date_range("2026-03-14", periods=3, freq="s")).to_parquet(path)
    assert set(read_logged_file(path)[0].channels.columns) == {"P1", "index"}
    table.set_index(pd.Index([0.0, 0.1, 0.2], name="t")).to_parquet(path)
    assert set(read_logged_file(path)[0].channels.columns) == {"P1", "t"}
    table[:0].to_parquet(path)
    with pytest.raises(RecordingError, match="holds no rows; expected one row per sample"):
        read_logged_file(path)


@pytest.mark.parametrize("large", [pa.string(), pa.large_string()])
@pytest.mark.parametrize("wanted", [None, ["stamp", "P1"]])
def test_dates_that_are_text_are_dates(tmp_path: Path, large: pa.DataType, wanted: list[str] | None) -> None:
    stamps = [f"2026-03-14T08:15:00.{5 * row:03d}+01:00" for row in range(40)]
    pq.write_table(pa.table({"stamp": pa.array(stamps, large), "P1": np.arange(40.0)}), tmp_path / "log")
    (read,) = read_logged_file(tmp_path / "log", wanted=wanted)
    assert read.utc
    assert read.channels["stamp"].iloc[1] == np.datetime64("2026-03-14T07:15:00.005")


def test_a_date_and_a_time_of_day_in_two_columns_are_one_stamp(tmp_path: Path) -> None:
    clock = pa.array(5000 * np.arange(40), pa.int64()).cast(pa.time64("us"))
    days = pa.array([20000] * 40, pa.int32()).cast(pa.date32())
    pq.write_table(pa.table({"Date": days, "Time": clock, "P1": np.arange(40.0)}), tmp_path / "log")
    (read,) = read_logged_file(tmp_path / "log", wanted=["Time", "P1"])
    assert list(read.channels) == ["Time", "P1"]
    assert read.channels["Time"].iloc[2] == np.datetime64("2024-10-04T00:00:00.010")
