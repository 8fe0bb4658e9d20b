"""JSON of the served model: what its forms decode to, estimates to the same bits, and short, printable refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from cylinder_friction.service.scoring.errors import Expected, error_body
from cylinder_friction.service.scoring.json_forms import from_json, to_json

EXPECTED = Expected(("a", "b"), 100)
NAMES = st.text(min_size=1, max_size=12) | st.sampled_from(["10:00", 'a"b', "back\\slash", "\\u003a", "{[:]}"])


@given(st.lists(NAMES, min_size=1, max_size=6), st.booleans())
def test_names_of_any_letters_pass_as_they_are(names: list[str], ascii_only: bool) -> None:
    records = [{"a": 1, "recording": name} for name in names]
    split = {"columns": ["a", "recording"], "data": [[1, name] for name in names]}
    inputs = {"a": [1] * len(names), "recording": names}
    for form, content in (("dataframe_records", records), ("dataframe_split", split), ("inputs", inputs)):
        columns = from_json(json.dumps({form: content}, ensure_ascii=ascii_only).encode(), EXPECTED)
        assert {name: list(values) for name, values in columns.items()} == inputs


@given(arrays.arrays(np.float64, st.integers(1, 6), elements=st.floats(allow_nan=False, allow_infinity=False)))
def test_floats_are_exact(values: np.ndarray) -> None:
    rows = json.loads(to_json({"friction_n": values, "flags": np.arange(len(values))}))["predictions"]
    assert [row["friction_n"] for row in rows] == values.tolist()
    assert [type(row["flags"]) for row in rows] == [int] * len(values)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.array([np.nan, np.inf, -np.inf]), [None, None, None]),
        (np.array([True, False]), [True, False]),
        (np.array(["WARMING", 'a "quote", and a comma', ""], dtype=object), ["WARMING", 'a "quote", and a comma', ""]),
        (np.arange(6.0).reshape(3, 2)[:, 1], [1.0, 3.0, 5.0]),
    ],
)
def test_every_kind_of_column_is_taken(values: np.ndarray, expected: list[object]) -> None:
    rows = json.loads(to_json({"first": values, "second": values}))["predictions"]
    assert rows == [{"first": value, "second": value} for value in expected]


@given(
    st.text(max_size=5) | st.sampled_from(["\x00", '"', "\\", "\u538b", "\U0001f600", "\ud800"]), st.integers(1, 9000)
)
def test_a_refusal_is_short_and_printable(part: str, times: int) -> None:
    body = error_body(422, part * times, "id-1")
    assert len(body) < 1400
    content = json.loads(body)
    assert (content["error_code"], content["request_id"]) == ("UNPROCESSABLE_ENTITY", "id-1")
    assert content["message"].isprintable()
