import io

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.formats.arrow_pipe import read_tables, write_tables
from cylinder_friction.recordings.formats.logged_table import LoggedTable


def named(names: list[str], *columns: object) -> pd.DataFrame:
    table = pd.DataFrame(dict(enumerate(columns)))
    table.columns = pd.Index(names, dtype=object)
    return table


TEXT_AND_NUMBERS = np.array(["up", 1.5, np.nan, -np.inf, "ü\ud800"], dtype=object)
STAMPS = np.array([0, 1, np.iinfo(np.int64).min, 2**62, -1], dtype="datetime64[ns]")
TABLES = {
    "numbers": named(
        ["a", "b", "c", "d"],
        np.array([0.1, -0.0, np.nan, np.inf, 5e-324]),
        np.arange(5, dtype=np.uint8),
        np.array([2**63 + 1] * 5, dtype=np.uint64),
        np.arange(5, dtype=np.float32),
    ),
    "one name twice": named(["P1", "P1"], np.arange(3.0), np.arange(3)),
    "a matrix's columns": named(["a", "b"], *np.arange(6.0).reshape(3, 2).T),
    "text": named(["state", "mixed", "when"], np.array(["ab"] * 5, dtype=object), TEXT_AND_NUMBERS, STAMPS),
    "no columns": named([]),
    "no columns, three rows": pd.DataFrame(index=pd.RangeIndex(3), columns=pd.Index([], dtype=object)),
    "no rows": named(["P1"], np.empty(0)),
}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_comes_out_as_it_went_in(name: str) -> None:
    table = LoggedTable(TABLES[name], {"P1": "°C", "b": "bar"}, "group \n 1", ("x", "x"), ("cut off",))
    pipe = io.BytesIO()
    write_tables(pipe, [table, LoggedTable(named(["z"], np.arange(2.0)))])
    pipe.seek(0)
    read, behind = read_tables(pipe)
    pd.testing.assert_frame_equal(read.channels, table.channels, check_exact=True, check_column_type=False)
    for number in range(read.channels.shape[1]):
        assert read.channels.iloc[:, number].dtype == table.channels.iloc[:, number].dtype
    assert (read.units, read.name, read.unread, read.notes) == (table.units, table.name, table.unread, table.notes)
    assert behind.channels["z"].tolist() == [0.0, 1.0]
    assert pipe.read() == b""


def test_a_table_cut_off_is_no_table() -> None:
    pipe = io.BytesIO()
    write_tables(pipe, [LoggedTable(named(["P1"], np.arange(3.0)))])
    with pytest.raises(EOFError):
        read_tables(io.BytesIO(pipe.getvalue()[:-1]))
