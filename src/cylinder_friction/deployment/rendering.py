"""Exported text from the templates in ``templates/``; every number in C reads back to the same value."""

import hashlib
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any, Literal

import jinja2
import numpy as np

from cylinder_friction.realtime.sensor_offset import OffsetSettings

Type = Literal["float", "double"]

LINE = 114


def number(value: float, kind: Type = "double") -> str:
    """Write the shortest literal of a type that reads back to the same value.

    Raises:
        ValueError: The value is not finite in that type.
    """
    rounded = np.float32(value) if kind == "float" else np.float64(value)
    if not np.isfinite(rounded):
        raise ValueError(f"expected a finite {kind} for the C source, but got {value!r}")
    text = str(rounded) if "." in str(rounded) or "e" in str(rounded) else f"{rounded}.0"
    return f"{text}f" if kind == "float" else text


def wrapped(items: Iterable[str]) -> str:
    """Join items by commas, in indented lines."""
    lines, line = [], "    "
    for item in items:
        if len(line) + len(item) + 2 > LINE:
            lines.append(line.rstrip())
            line = "    "
        line += f"{item}, "
    lines.append(line.rstrip().removesuffix(","))
    return "\n".join(lines)


ABSENT: dict[str, Any] = {
    **{"offset": None, "spread_n": (0.0, 0.0, 0.0, 0.0), "lag_s": 0.0, "position_load": None, "clear_samples": 0},
    "trained_for": None,
    "corrections": {},
    "line_loss": {},
    "least_pressure_pa": -1e12,
    **dict.fromkeys(("force_weights", "sliding_lower", "sliding_upper", "largest_force"), ()),
}
"""Values of fields in a model without sensor offset, lag, load by position, corrections of channels, loss of lines,
and range of the force balance; fields with these values do not change the hash."""


def render(template: str, real: Type = "double", **values: Any) -> str:
    """Fill a template of ``templates/`` with values; a missing value is an error.

    Values in XML and HTML are escaped; ``real`` is the C type of the filter ``real``.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("cylinder_friction.deployment", "templates"),
        autoescape=jinja2.select_autoescape(["xml.j2", "html.j2"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"real": partial(number, kind=real), "double": partial(number, kind="double")}
    return environment.get_template(template).render(real=real, **values)


def model_hash(model: Any) -> str:
    """Return the SHA-256 of every number of a model of dataclasses, the same in every export and on every machine."""
    digest = hashlib.sha256()
    _add(digest, model)
    return digest.hexdigest()


def _add(digest: Any, value: Any) -> None:
    if is_dataclass(value):
        for field in fields(value):
            if field.name in ABSENT and getattr(value, field.name) == ABSENT[field.name]:
                continue
            digest.update(field.name.encode())
            _add(digest, getattr(value, field.name))
    elif isinstance(value, (np.ndarray, OffsetSettings)):
        value = np.asarray(value)
        ordered = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("<"))
        digest.update(f"{ordered.dtype.str}{ordered.shape}".encode())
        digest.update(ordered.tobytes())
    else:
        digest.update(repr(value).encode())
