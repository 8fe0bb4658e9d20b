"""Refusals: short and printable, whatever is in their message."""

from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.service.scoring.errors import error_body


@given(
    st.text(max_size=5) | st.sampled_from(["\x00", '"', "\\", "\u538b", "\U0001f600", "\ud800"]), st.integers(1, 9000)
)
def test_a_refusal_is_short_and_printable(part: str, times: int) -> None:
    body = error_body(422, part * times, "id-1")
    assert len(body) < 1400
    content = json.loads(body)
    assert (content["error_code"], content["request_id"]) == ("UNPROCESSABLE_ENTITY", "id-1")
    assert content["message"].isprintable()
