"""What monitoring refuses: an error, and logs or sessions that a run leaves aside."""

from dataclasses import dataclass


class MonitoringError(ValueError):
    """Something that cannot be used; the message states what, where, found, expected and what to do."""


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
