"""`estimate` computes from many logs what it computed before; `tools/corpus.py` records and explains new columns."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "tools"))
import corpus  # noqa: E402

DATA = ROOT / "../shared/data"
OTHERS = {"crane": DATA / "crane/scope", "field-logs": DATA / "field-logs"}


@pytest.mark.extended
@pytest.mark.parametrize("group", corpus.GROUPS)
def test_columns_are_as_stored(group: str) -> None:
    if group in OTHERS and not OTHERS[group].is_dir():
        pytest.skip("recordings of others are not there")
    stored = corpus.stored_columns(group)
    assert any(name.endswith("/friction_n") for name in stored)
    assert corpus.differences(stored, corpus.computed(group, DATA)) == []


@pytest.mark.parametrize(
    ("column", "line"),
    [
        ([0.0, 1.0, np.nan, 3.0], ""),
        ([0.0, 1.0 + 2e-9, np.nan, 3.0], ""),
        ([0.0, 1.0 + 2e-8, np.nan, 3.0], "a/x/friction_n/figures: differs by 2.2e-09 of its span"),
        ([0.0, 1.0, 2.0, np.nan], "a/x/friction_n/figures: differs by 2.7e-01 of its span"),
        ([0.0, 1.0, np.nan], "a/x/friction_n/figures: differs by 1.1e+00 of its span"),
        ([np.nan, 1.0, 2.0, 3.0], "a/x/friction_n: other rows have a value, or there are 1 in place of 1"),
        (None, "a/x/friction_n: is no longer computed"),
    ],
    ids=["nothing", "a last digit", "between stored rows", "a value moved", "a row less", "a stored value", "not read"],
)
def test_what_differs_is_found(column: list[float] | None, line: str) -> None:
    stored = corpus.shortened({"a/x/friction_n": np.array([0.0, 1.0, np.nan, 3.0])})
    lines = corpus.differences(stored, {} if column is None else {"a/x/friction_n": np.array(column)})
    assert (line in lines) if line else lines == []


def test_commits_differ_by_one_bit_or_by_a_column() -> None:
    one = corpus.hashes({"a": np.array([0.0]), "b": np.array([1.0]), "c": np.array([2.0])})
    other = corpus.hashes({"a": np.array([-0.0]), "b": np.array([1.0]), "d": np.array([2.0])})
    assert corpus.unequal(one, one) == []
    lines = ["c: only the first has it", "d: only the second has it", "a: other bits"]
    assert corpus.unequal(one, other) == lines
