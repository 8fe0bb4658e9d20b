"""MLflow's JSON forms: what they decode to, and keys that are there twice, which no decoder reports."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.service.scoring.errors import Expected, RequestError
from cylinder_friction.service.scoring.json_forms import from_json

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


@given(st.lists(NAMES, min_size=2, max_size=5, unique=True), st.integers(0, 4), NAMES, st.booleans())
def test_a_key_that_is_there_twice_is_found(keys: list[str], which: int, name: str, ascii_only: bool) -> None:
    def text(value: Any) -> str:
        return json.dumps(value, ensure_ascii=ascii_only)

    pairs = [(key, 1.0) for key in keys] + [(keys[which % len(keys)], 2.0)]
    record = ",".join(f"{text(key)}:{value}" for key, value in pairs)
    other = ",".join(f"{text(key)}:1.0" for key in keys)
    body = f'{{"dataframe_records":[{{{other}}},{{{record}}}], "params": null}}'
    with pytest.raises(RequestError, match="is twice in one object; expected each key once") as raised:
        from_json(body.encode(), EXPECTED)
    assert raised.value.status == 400


def test_empty_lists_are_counted_before_they_take_memory() -> None:
    with pytest.raises(RequestError, match="more than twice as many lists or objects as rows are allowed, 100"):
        from_json(b'{"instances":[%s' % (b"[]," * 301), EXPECTED)
