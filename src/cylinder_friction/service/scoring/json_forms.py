"""Samples from the four JSON forms that MLflow's server takes, and estimates in its form."""

import json
from collections.abc import Iterable, Mapping
from itertools import chain, repeat
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from cylinder_friction.deployment.scoring import shown
from cylinder_friction.service.scoring.errors import Columns, Expected, RequestError, refuse_names

FORMS = ("dataframe_split", "dataframe_records", "inputs", "instances")


def from_json(body: bytes, expected: Expected) -> Columns:
    """Return the columns of one of MLflow's four JSON forms."""
    if (
        body.count(b"[") + body.count(b"{") > 2 * expected.max_rows + 100
    ):  # decoded, empty ones take 20 times their size
        raise RequestError(
            413, f"got more than twice as many lists or objects as rows are allowed, {expected.max_rows}"
        )
    try:
        content = orjson.loads(body)
    except orjson.JSONDecodeError as error:
        raise RequestError(400, f"the body is not JSON: {error.msg} at byte {error.pos}") from None
    if not isinstance(content, dict):
        raise RequestError(400, f"the body is {_kind(content)}; expected an object with one of {list(FORMS)}")
    given = [form for form in FORMS if form in content]
    if len(given) != 1 or content.keys() - {*given, "params"}:
        raise RequestError(400, f"the body has the keys {_names(content)}; expected exactly one of {list(FORMS)}")
    if content.get("params"):
        raise RequestError(422, "params are given, but the model takes none")
    form = given[0]
    columns, keys = _FORMS[form](content[form], form, expected)
    if body.count(b":") != keys + len(content) or b"\\" in body:  # else no key can be there twice
        _refuse_repeated_keys(body)
    return columns


def _from_split(split: Any, form: str, expected: Expected) -> tuple[Columns, int]:
    if not isinstance(split, dict) or not {"columns", "data"} <= split.keys() <= {"columns", "data", "index"}:
        got = _names(split) if isinstance(split, dict) else _kind(split)
        raise RequestError(422, f"{form} has {got}; expected an object with columns and data")
    names, rows = split["columns"], split["data"]
    for key, value in split.items():
        if not isinstance(value, list):
            raise RequestError(422, f"{form}: {key} is {_kind(value)}; expected a list")
    refuse_names(names)
    expected.refuse_rows(len(rows))
    if "index" in split and len(split["index"]) != len(rows):
        raise RequestError(422, f"{form}: index has {len(split['index'])} values, data {len(rows)} rows")
    if "index" in split and split["index"] != list(range(len(rows))):
        raise RequestError(422, f"{form}: index does not count the rows from 0; send what it holds as a column")
    if not set(map(type, rows)) <= {list} or not set(map(len, rows)) <= {len(names)}:
        at = next(at for at, row in enumerate(rows) if not isinstance(row, list) or len(row) != len(names))
        got = f"{len(rows[at])} values" if isinstance(rows[at], list) else _kind(rows[at])
        raise RequestError(422, f"{form}: row {at} is {got}; expected a list of {len(names)} values, one per column")
    values = zip(*rows, strict=True) if rows else ((),) * len(names)
    return dict(zip(names, values, strict=True)), len(split)


def _from_records(rows: Any, form: str, expected: Expected) -> tuple[Columns, int]:
    if not isinstance(rows, list):
        raise RequestError(422, f"{form} is {_kind(rows)}; expected a list of objects")
    expected.refuse_rows(len(rows))
    if not set(map(type, rows)) <= {dict}:
        at = next(at for at, row in enumerate(rows) if not isinstance(row, dict))
        raise RequestError(422, f"{form}: row {at} is {_kind(rows[at])}; expected an object")
    names = list(rows[0]) if rows else []
    refuse_names(names)
    try:
        columns: Columns = {name: [row[name] for row in rows] for name in names}
        differ = not set(map(len, rows)) <= {len(names)}
    except KeyError:
        differ = True
    if differ:
        at = next(at for at, row in enumerate(rows) if row.keys() != rows[0].keys())
        raise RequestError(422, f"{form}: row {at} has {_names(rows[at])}; expected {_names(names)} as in row 0")
    return columns, len(names) * len(rows)


def _from_inputs(inputs: Any, form: str, expected: Expected) -> tuple[Columns, int]:
    if not isinstance(inputs, dict):
        raise RequestError(422, f"{form} is {_kind(inputs)}; expected an object with one list per column")
    refuse_names(list(inputs))
    for name, values in inputs.items():
        if not isinstance(values, list):
            raise RequestError(422, f"{form}: column {shown(name)} is {_kind(values)}; expected a list")
        expected.refuse_rows(len(values))
    return dict(inputs), len(inputs)


_FORMS = dict(zip(FORMS, (_from_split, _from_records, _from_inputs, _from_records), strict=True))


def _refuse_repeated_keys(body: bytes) -> None:
    """Decode again, slowly, to find a key that is twice in one object."""

    def refuse(pairs: list[tuple[str, Any]]) -> None:
        seen = set()
        for key, _ in pairs:
            if key in seen:
                raise RequestError(400, f"key {shown(key)} is twice in one object; expected each key once")
            seen.add(key)

    try:
        json.loads(body, object_pairs_hook=refuse, parse_int=float)
    except (ValueError, RecursionError):
        raise RequestError(400, "the body is not JSON that can be read safely") from None


def _names(names: Iterable[Any]) -> str:
    first = list(names)
    more = ", ..." if len(first) > 8 else ""
    return f"[{', '.join(shown(name) for name in first[:8])}{more}]"


def _kind(value: object) -> str:
    kinds = {dict: "an object", list: "a list", str: "text", bool: "a boolean", type(None): "null"}
    return kinds.get(type(value), "a number")


def to_json(columns: Mapping[str, NDArray[Any]]) -> bytes:
    """Return ``{"predictions": [...]}`` with one object per row; what is not finite is null.

    Columns are encoded whole and their values then put together, which takes half as long as encoding rows.
    """
    parts: list[Any] = []
    for name, values in columns.items():
        parts += [repeat(b'%s"%s":' % (b"," if parts else b"},{", name.encode())), _encoded(values)]
    rows = b"".join(chain.from_iterable(zip(*parts, strict=False)))  # names are repeated without end
    return b'{"predictions":[%s}]}' % rows[2:]


def _encoded(values: NDArray[Any]) -> list[bytes]:
    """Return the JSON of each value."""
    if values.dtype == object:
        texts = values.tolist()
        encoded = {text: orjson.dumps(text) for text in set(texts)}
        return [encoded[text] for text in texts]
    return orjson.dumps(np.ascontiguousarray(values), option=orjson.OPT_SERIALIZE_NUMPY)[1:-1].split(b",")
