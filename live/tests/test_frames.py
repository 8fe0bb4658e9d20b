"""Frames and JSON of the live service: what is none is refused as a whole, with what is wrong."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction_live.frames import HEADER, SAMPLES, FrameError, unpack
from cylinder_friction_live.service import LiveError
from cylinder_friction_live.text_forms import read_text


@given(st.binary(max_size=200))
def test_garbage_is_refused_or_is_blocks(message: bytes) -> None:
    try:
        blocks = unpack(message)
    except FrameError as error:
        assert "expected" in str(error) or "beyond" in str(error)  # noqa: PT017 - either outcome is right
    else:
        assert blocks


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (b"", "empty message"),
        (b"\x01", "1 bytes are left, expected a header of 24"),
        (HEADER.pack(SAMPLES, 3, 2, 1, 0, 0.0) + bytes(40), "40 bytes are left, expected 48 for 2 rows"),
        (HEADER.pack(9, 3, 2, 1, 0, 0.0), "got kind 9"),
        (HEADER.pack(SAMPLES, 3, 0, 1, 0, 0.0), "3 columns and 0 rows"),
        (HEADER.pack(SAMPLES, 1, 1, 1, 1 << 60, 0.0) + bytes(8), "beyond 2"),
    ],
)
def test_what_is_no_frame_is_named(message: bytes, words: str) -> None:
    with pytest.raises(FrameError, match=words):
        unpack(message)


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
        ("samples", {"rows": [[[1.0], 1.0]]}),
        ("samples", {"rows": []}),
        ("samples", {"index": 1.5}),
        ("samples", {"index": "3"}),
        ("samples", {"index": -1}),
        ("samples", {"index": 1 << 53}),
        ("samples", {"time_s": "10"}),
        ("samples", {"session": 5}),
        ("open", {"session": None}),
        ("open", {"sample_time_s": True}),
        ("open", {"inputs": [1]}),
        ("open", {"estimates_from": -1}),
        ("open", {"estimates_from": 1 << 60}),
    ],
)
def test_what_is_another_kind_of_value_is_refused(kind: str, changed: dict[str, Any]) -> None:
    with pytest.raises(LiveError, match=r"; expected \{\"open\": "):
        read_text(json.dumps({kind: (OPEN if kind == "open" else SAMPLES) | changed}))
