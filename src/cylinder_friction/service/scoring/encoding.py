"""Estimates as JSON in MLflow's form, each number in its shortest exact decimals."""

from collections.abc import Mapping
from itertools import chain, repeat
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray


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
