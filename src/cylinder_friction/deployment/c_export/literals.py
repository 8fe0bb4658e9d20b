"""Numbers and arrays as C99 source text; every number reads back to the very same value."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Type = Literal["float", "double"]

LINE = 114


def number(value: float, kind: Type) -> str:
    """Return a literal of that type: the shortest that reads back to the same value.

    Raises:
        ValueError: The value is not finite in that type.
    """
    rounded = np.float32(value) if kind == "float" else np.float64(value)
    if not np.isfinite(rounded):
        raise ValueError(f"expected a finite {kind} for the C source, but got {value!r}")
    text = str(rounded) if "." in str(rounded) or "e" in str(rounded) else f"{rounded}.0"
    return f"{text}f" if kind == "float" else text


def numbers(values: ArrayLike, kind: Type) -> str:
    """Return the numbers of an array in C order, with commas, wrapped."""
    return wrapped(number(value, kind) for value in np.asarray(values).ravel().tolist())


def wrapped(items: Iterable[str]) -> str:
    """Return items with commas between them, in indented lines."""
    lines, line = [], "    "
    for item in items:
        if len(line) + len(item) + 2 > LINE:
            lines.append(line.rstrip())
            line = "    "
        line += f"{item}, "
    lines.append(line.rstrip().removesuffix(","))
    return "\n".join(lines)
