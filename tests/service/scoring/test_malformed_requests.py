"""Malformed requests to a small model: each gets what it should, no number is wrong, and the server never fails."""

import json
from collections import Counter
from typing import Any

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

import malformed_requests
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.service.scoring.decoding import ARROW, CSV, JSON, PARQUET

Request = tuple[bytes, str]

ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner, max_size=4),
    max_leaves=8,
)


def test_the_table_of_requests_holds(server: Any, small_model: StepModel, labelled_recordings: list[Recording]) -> None:
    wrong = []
    for case in malformed_requests.cases(labelled_recordings[0].samples()[:700]):
        reply, text = malformed_requests.problem(case, server, lambda samples: RealTimeStream(small_model).run(samples))
        wrong += [f"{case.name}: {reply and reply.status} {text}"] if text else []
    assert wrong == []
    assert server.get("/livez").status == 200


@st.composite
def with_another_value(draw: st.DrawFn, whole: Any) -> Any:
    """Return a value in which one part, at some depth, is any other JSON."""
    if not isinstance(whole, dict | list) or not whole or draw(st.integers(0, 3)) == 0:
        return draw(ANY_JSON)
    copy = dict(whole) if isinstance(whole, dict) else list(whole)
    at = draw(st.sampled_from([*whole] if isinstance(whole, dict) else range(len(whole))))
    copy[at] = draw(with_another_value(whole[at]))
    return copy


@st.composite
def with_other_bytes(draw: st.DrawFn, request: Request) -> Request:
    """Return a request in whose body some bytes are changed, cut out or repeated."""
    body = bytearray(request[0])
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(body)))
        end = draw(st.integers(begin, min(len(body), begin + 12)))
        body[begin:end] = draw(st.sampled_from([b"", bytes(body[begin:end]) * 3]) | st.binary(max_size=8))
    return bytes(body), request[1]


def requests() -> st.SearchStrategy[Request]:
    """Return requests in which any value of a form of JSON, or any bytes of a format, are others."""
    rows = np.array([[1.2e6, 9.1e5, 0.12], [1.3e6, 9.0e5, 0.121]])
    table = malformed_requests.arrow_table(rows)
    forms = [malformed_requests.split(rows), malformed_requests.records(rows), {"inputs": table.to_pydict()}]
    good = [(json.dumps(forms[0]).encode(), JSON), (malformed_requests.csv(rows), CSV)]
    good += [(malformed_requests.arrow_stream(table), ARROW), (malformed_requests.parquet_file(table), PARQUET)]
    changed = st.sampled_from(forms).flatmap(with_another_value)
    return changed.map(lambda body: (json.dumps(body).encode(), JSON)) | st.sampled_from(good).flatmap(with_other_bytes)


def test_no_random_change_of_a_request_makes_the_server_fail(server: Any) -> None:
    found: Counter[int] = Counter()

    @seed(1)
    @settings(
        max_examples=250, deadline=None, database=None, phases=[Phase.generate], suppress_health_check=[*HealthCheck]
    )
    @given(requests())
    def send(request: Request) -> None:
        reply = server.ask(*request)
        found[reply.status] += 1
        if reply.status != 200:
            assert len(reply.body) <= malformed_requests.LARGEST_REFUSAL_BYTES
            assert {*reply.json()} == {"error_code", "message", "request_id"}

    send()
    assert {*found} == {200, 400, 422}
    assert min(found.values()) > 5
