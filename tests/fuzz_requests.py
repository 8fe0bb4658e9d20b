"""Random requests to the served model, made from its own OpenAPI description: no error of the server, ever.

A third are bodies as the schema allows them; a third are such bodies in which a value was exchanged for any other JSON;
a third are bodies of all formats in which bytes were changed, cut out or repeated.
"""

from __future__ import annotations

import io
import json
from collections import Counter
from typing import Any

import pyarrow as pa
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from pyarrow import parquet

from cylinder_friction.service.scoring.decoding import ARROW, CSV, JSON, PARQUET
from malformed_requests import LARGEST_REFUSAL_BYTES, Server

Request = tuple[bytes, str]

ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner, max_size=4),
    max_leaves=8,
)


def from_schema(schema: dict[str, Any], schemas: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Return values of a JSON schema, of the keywords that ours has."""
    if "$ref" in schema:
        return from_schema(schemas[schema["$ref"].rpartition("/")[2]], schemas)
    if "oneOf" in schema:
        return st.one_of([from_schema(each, schemas) for each in schema["oneOf"]])
    if isinstance(schema["type"], list):
        return st.one_of([from_schema({**schema, "type": kind}, schemas) for kind in schema["type"]])
    if schema["type"] == "array":
        items, least = from_schema(schema["items"], schemas), schema.get("minItems", 0)
        return st.lists(items, min_size=least, max_size=5, unique=schema.get("uniqueItems", False))
    if schema["type"] == "object":
        if "properties" not in schema:
            return st.dictionaries(
                st.text(max_size=9), from_schema(schema["additionalProperties"], schemas), max_size=4
            )
        parts = {name: from_schema(each, schemas) for name, each in schema["properties"].items()}
        optional = {name: parts.pop(name) for name in [*parts] if name not in schema["required"]}
        return st.fixed_dictionaries(parts, optional=optional)
    plain: dict[str, st.SearchStrategy[Any]] = {
        "number": st.floats(allow_nan=False, allow_infinity=False) | st.floats(-1.0, 1e7),
        "integer": st.integers(),
        "string": st.text(min_size=schema.get("minLength", 0), max_size=9),
    }
    return plain[schema["type"]]


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


def requests(described: dict[str, Any]) -> st.SearchStrategy[Request]:
    """Return requests to ``/invocations`` of a described server."""
    content = described["paths"]["/invocations"]["post"]["requestBody"]["content"]
    allowed = from_schema(content[JSON]["schema"], described["components"]["schemas"])
    example = content[JSON]["example"]["dataframe_split"]
    table = pa.table(dict(zip(example["columns"], zip(*example["data"], strict=True), strict=True)))
    stream, file = io.BytesIO(), io.BytesIO()
    with pa.ipc.new_stream(stream, table.schema) as writer:
        writer.write_table(table)
    parquet.write_table(table, file)
    good = [(json.dumps(content[JSON]["example"]).encode(), JSON), (content[CSV]["example"].encode(), CSV)]
    good += [(stream.getvalue(), ARROW), (file.getvalue(), PARQUET)]
    either = st.just(content[JSON]["example"]) | allowed
    bodies = allowed | either.flatmap(with_another_value)
    return bodies.map(lambda body: (json.dumps(body).encode(), JSON)) | st.sampled_from(good).flatmap(with_other_bytes)


def check(server: Server, request: Request) -> str:
    """Send a request; return its status, or what is wrong."""
    reply = server.ask(*request)
    if reply.status != 200:
        short = len(reply.body) <= LARGEST_REFUSAL_BYTES and {*reply.json()} == {"error_code", "message", "request_id"}
        return (
            str(reply.status) if 400 <= reply.status < 500 and short else f"{reply.status} WRONG {reply.body[:200]!r}"
        )
    if request[1] != JSON:
        return "200"
    ((form, content),) = ((form, content) for form, content in json.loads(request[0]).items() if form != "params")
    sent = content["data"] if form == "dataframe_split" else content
    count = len(next(iter(sent.values()))) if isinstance(sent, dict) else len(sent)
    return "200" if len(reply.json()["predictions"]) == count else f"200 WRONG rows for {request[0]!r}"


def run(server: Server, examples: int, start: int) -> Counter[str]:
    """Send so many requests and count what they got."""
    found: Counter[str] = Counter()

    @seed(start)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=[*HealthCheck],
    )
    @given(requests(server.get("/openapi.json").json()))
    def send(request: Request) -> None:
        found[check(server, request)] += 1

    send()
    return found
