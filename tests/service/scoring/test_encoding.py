"""Estimates as JSON: every number comes back as the same bits."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from cylinder_friction.service.scoring.json_forms import to_json


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
