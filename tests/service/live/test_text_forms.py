"""What JSON of the live service is, and what only looks like it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from cylinder_friction.service.live.service import LiveError
from cylinder_friction.service.live.text_forms import read_text

OPEN = {"session": "press", "inputs": ["position_m"], "sample_time_s": 0.005}
SAMPLES = {"session": "press", "index": 3, "time_s": 10, "rows": [[1, None], [0.5, -2e5]]}


def test_numbers_and_missing_ones_are_read() -> None:
    assert read_text(json.dumps({"open": {**OPEN, "estimates_from": 7}})).estimates_from == 7
    read = read_text(json.dumps({"samples": SAMPLES}))
    assert (read.session, read.index, read.time_s) == ("press", 3, 10.0)
    np.testing.assert_array_equal(read.samples, [[1.0, np.nan], [0.5, -2e5]])


@pytest.mark.parametrize(
    ("kind", "changed"),
    [
        ("samples", {"rows": [[True, 1.0]]}),
        ("samples", {"rows": [["1.0", 1.0]]}),
        ("samples", {"rows": [[[1.0], 1.0]]}),
        ("samples", {"rows": []}),
        ("samples", {"index": 1.5}),
        ("samples", {"index": True}),
        ("samples", {"index": "3"}),
        ("samples", {"index": -1}),
        ("samples", {"index": 1 << 53}),
        ("samples", {"time_s": "10"}),
        ("samples", {"time_s": False}),
        ("samples", {"session": 5}),
        ("open", {"session": None}),
        ("open", {"sample_time_s": "0.005"}),
        ("open", {"sample_time_s": True}),
        ("open", {"inputs": [1]}),
        ("open", {"estimates_from": -1}),
        ("open", {"estimates_from": 1 << 60}),
        ("open", {"estimates_from": 1.0}),
    ],
)
def test_what_is_another_kind_of_value_is_refused(kind: str, changed: dict[str, Any]) -> None:
    with pytest.raises(LiveError, match=r"; expected \{\"open\": "):
        read_text(json.dumps({kind: (OPEN if kind == "open" else SAMPLES) | changed}))
