"""Errors of monitoring, and logs, sessions or files that a run does not use."""

from dataclasses import dataclass


class MonitoringError(ValueError):
    """An input that cannot be used; the message states what, where, found, expected and what to do."""


@dataclass(frozen=True)
class Refused:
    """A file, or a ``piece`` of one, that is not used, and why."""

    file: str
    reason: str
    piece: str = ""

    @property
    def where(self) -> str:
        """The file and its piece, in words."""
        return f"{self.file} ({self.piece})" if self.piece else self.file
