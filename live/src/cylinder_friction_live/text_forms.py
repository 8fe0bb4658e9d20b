"""JSON forms of the frames, for people and for opening sessions."""

import json
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.flags import Flag
from cylinder_friction_live.frames import LARGEST_INDEX, EstimateBlock
from cylinder_friction_live.service import LiveError, LiveSession

_OPEN = '{"open": {"session": NAME, "inputs": [...], "sample_time_s": 0.005, "estimates_from": null}}'
_SAMPLES = '{"samples": {"session": NAME, "index": 0, "time_s": 0.0, "rows": [[...], ...]}}'
EXPECTED = f"expected {_OPEN} or {_SAMPLES}"


@dataclass(frozen=True)
class TextMessage:
    """A client's request in JSON: to open a session, or to take samples of an open one."""

    opens: bool
    session: str
    inputs: tuple[str, ...] = ()
    sample_time_s: float = 0.0
    estimates_from: int | None = None  # First index without an estimate at the client; None: only new estimates
    index: int = 0
    time_s: float = 0.0
    samples: Array = field(default_factory=lambda: np.zeros((0, 0)))


def read_text(text: str) -> TextMessage:
    """Parse a text; a null value is no number, as from a broken wire.

    Raises:
        LiveError: The text has neither form.
    """
    try:
        content = json.loads(text)
        ((kind, body),) = content.items()
        if kind == "open":
            inputs = tuple(_of(str, name) for name in body["inputs"])
            since = body.get("estimates_from")
            sample_time_s = float(_of((int, float), body["sample_time_s"]))
            from_index = None if since is None else _index(since)
            return TextMessage(True, _of(str, body["session"]), inputs, sample_time_s, from_index)
        if kind != "samples":
            raise LiveError(f"got {kind[:80]!r}; {EXPECTED}")
        rows = np.array([[_number(value) for value in row] for row in body["rows"]], np.float64)
        session, index = _of(str, body["session"]), _index(body["index"])
        time_s = float(_of((int, float), body.get("time_s", 0.0)))
    except LiveError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
        raise LiveError(f"got {text[:80]!r} ({type(error).__name__}); {EXPECTED}") from error
    if rows.ndim != 2 or not 0 < len(rows) < 1 << 16:
        raise LiveError(f"got rows of shape {rows.shape} from index {index}; {EXPECTED}")
    return TextMessage(False, session, index=index, time_s=time_s, samples=rows)


def _of(kind: type | tuple[type, ...], value: Any) -> Any:
    """Check the kind of a JSON value: true is no number, and neither is text that looks like one."""
    if isinstance(value, bool) or not isinstance(value, kind):
        raise TypeError(value)
    return value


def _number(value: Any) -> float:
    return math.nan if value is None else float(_of((int, float), value))


def _index(value: Any) -> int:
    if not 0 <= _of(int, value) < LARGEST_INDEX:
        raise ValueError(value)
    return int(value)


def opened_text(session: LiveSession) -> str:
    """Write the reply to an opened session: its handle, the index to send from, and why it begins anew, if so."""
    opened = {
        "session": session.name,
        "handle": session.handle,
        "next_index": session.next_index,
        "kept_index": session.kept_index,
        "model": session.model,
        "begins_anew": session.begins_anew,
        "counts": vars(session.order.counts),
    }
    return json.dumps({"opened": opened})


def estimates_text(session: LiveSession, block: EstimateBlock) -> str:
    """Write estimates as JSON, flags by name."""
    columns = dict(zip(("friction_n", "lower_n", "upper_n"), block.newtons.T.tolist(), strict=True))
    flags = [list(Flag.names(flags)) for flags in block.flags.tolist()]
    return json.dumps({"estimates": {"session": session.name, "index": block.index, **columns, "flags": flags}})
