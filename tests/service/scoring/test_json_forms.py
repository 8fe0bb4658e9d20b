"""MLflow's JSON forms: what they decode to, and keys that are there twice, which no decoder reports."""

from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.service.scoring.errors import Expected
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
