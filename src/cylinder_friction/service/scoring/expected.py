"""What a body should hold, and the refusals that all its formats share."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cylinder_friction.deployment.scoring import Column
from cylinder_friction.service.scoring.errors import RequestError, shown

Columns = dict[str, Column]
MAX_COLUMNS = 64


@dataclass(frozen=True)
class Expected:
    """What a body should hold: at least the columns ``inputs``, and at most ``max_rows`` rows."""

    inputs: tuple[str, ...]
    max_rows: int

    def refuse_rows(self, count: int) -> None:
        """Raise ``RequestError`` (413) for too many rows."""
        if count > self.max_rows:
            raise RequestError(413, f"got {count} rows; expected at most {self.max_rows}; send recordings one by one")


def refuse_names(names: Sequence[Any]) -> None:
    """Refuse column names that are no text, there twice, or very many.

    Raises:
        RequestError: 422.
    """
    for at, name in enumerate(names):
        if not isinstance(name, str):
            raise RequestError(422, f"column {at} has the name {shown(name)}; expected text")
    if len(set(names)) < len(names):
        twice = next(name for at, name in enumerate(names) if name in names[:at])
        raise RequestError(422, f"column {shown(twice)} is there more than once; expected each column once")
    if len(names) > MAX_COLUMNS:
        raise RequestError(422, f"got {len(names)} columns; expected at most {MAX_COLUMNS}")
