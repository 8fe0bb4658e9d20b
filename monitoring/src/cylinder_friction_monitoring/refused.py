"""Logs that were not taken, and sessions that are not assessed."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Refused:
    """A file, or a ``piece`` of one, that did not become a session, and why."""

    file: str
    reason: str
    piece: str = ""

    @property
    def where(self) -> str:
        """The file and its piece, in words."""
        return f"{self.file} ({self.piece})" if self.piece else self.file
