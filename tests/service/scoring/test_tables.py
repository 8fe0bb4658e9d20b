"""Arrow, Parquet and CSV: what columns they become, and bodies that would take far more memory than they are long."""

import tracemalloc
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.service.scoring.errors import Expected, RequestError
from cylinder_friction.service.scoring.tables import from_arrow, from_csv, from_parquet
from malformed_requests import arrow_stream, parquet_file

EXPECTED = Expected(("a", "b"), 30_000)


@pytest.mark.parametrize(("decode", "write"), [(from_arrow, arrow_stream), (from_parquet, parquet_file)])
def test_one_long_name_is_not_repeated_for_every_row(
    decode: Callable[..., dict[str, object]], write: Callable[..., bytes]
) -> None:
    names = pa.array(["n" * 10_000] * 20_000).dictionary_encode()
    body = write(pa.table({"a": np.zeros(20_000), "recording": names}))
    assert len(body) < 500_000
    tracemalloc.start()
    before = pa.total_allocated_bytes()
    columns = decode(body, EXPECTED)
    peak, taken = tracemalloc.get_traced_memory()[1], pa.total_allocated_bytes() - before
    tracemalloc.stop()
    assert len(columns["recording"]) == 20_000  # type: ignore[arg-type]
    assert peak + taken < 20e6


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        (pa.nulls(10**9), "null"),
        (pa.RunEndEncodedArray.from_arrays(pa.array([10**9], pa.int32()), pa.array([1.0])), "run_end_encoded"),
    ],
)
def test_a_column_that_stands_for_far_more_rows_than_bytes_is_refused(values: pa.Array, kind: str) -> None:
    with pytest.raises(RequestError, match=f"column 'a' holds {kind}"):
        from_arrow(arrow_stream(pa.table({"a": values})), EXPECTED)


GOOD = pa.table(
    {"a": np.arange(9.0), "b": pa.array([1, None, 3] * 3), "recording": pa.array(["x", "yy", None] * 3), "c": ["q"] * 9}
)
BODIES = [
    (from_arrow, arrow_stream(GOOD)),
    *((from_parquet, parquet_file(GOOD, how)) for how in ("none", "snappy", "zstd")),
]


@settings(max_examples=400, deadline=None)
@given(
    st.sampled_from(BODIES), st.lists(st.tuples(st.floats(0.0, 0.999), st.binary(min_size=1, max_size=4)), min_size=1)
)
def test_corrupted_bodies_are_refused_or_read(
    good: tuple[Callable[..., dict[str, object]], bytes], changes: list[tuple[float, bytes]]
) -> None:
    decode, body = good[0], bytearray(good[1])
    for at, changed in changes:
        begin = int(at * len(body))
        body[begin : begin + len(changed)] = changed
    with suppress(RequestError):
        assert {*map(len, decode(bytes(body), EXPECTED).values())} <= set(range(EXPECTED.max_rows + 1))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ('{"index_columns": [{"kind": "range", "start": 0, "stop": 4, "step": 2}]}', "the index leaves out rows"),
        ('{"index_columns": [{"kind": "range", "start": 5, "stop": 7, "step": 1}]}', "the index leaves out rows"),
        ("{", "the metadata of pandas in the schema cannot be read"),
        ("[1]", "the metadata of pandas in the schema cannot be read"),
    ],
)
def test_an_index_with_gaps_is_refused(metadata: str, message: str) -> None:
    table = pa.table({"a": [1.0, 2.0]}).replace_schema_metadata({"pandas": metadata})
    for decode, body in ((from_arrow, arrow_stream(table)), (from_parquet, parquet_file(table))):
        with pytest.raises(RequestError, match=message):
            decode(body, EXPECTED)


def test_csv_gives_numbers_of_inputs_and_text_of_all_else() -> None:
    columns = from_csv(b"a,b,recording,c\n1,2,007,true\n1e3,-2.5,7,\n", EXPECTED)
    assert {name: list(values) for name, values in columns.items()} == {
        "a": [1.0, 1000.0], "b": [2.0, -2.5], "recording": ["007", "7"], "c": ["true", ""]
    }  # fmt: skip
