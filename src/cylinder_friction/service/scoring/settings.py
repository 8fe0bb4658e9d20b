"""What a server is given: address, limits, tokens, logs."""

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Self

from cylinder_friction.service.access import Access, AccessError

MIB = 1 << 20


class ServingError(AccessError):
    """Settings or a model that cannot be served; the message states what to do."""


@dataclass(frozen=True)
class ServeSettings(Access):
    """Settings of all processes of one server: address, limits, logs, and who may reach it.

    Attributes:
        host: Name or address to listen on; other than loopback only with ``tokens``, or ``without_tokens``.
        port: 0 for a free one.
        workers: Processes that score.
        max_body_bytes: Largest body of a request, as sent and uncompressed; beyond it 413.
        max_rows: Most rows of a request; beyond it 413.
        timeout_s: How long a body may take to arrive (408), and rows to be scored (503) [s].
        max_concurrent: Most requests that a worker has at a time; beyond it 429.
        max_memory_bytes: Most memory of a worker; a request that needs more gets 503.
        access_log: File of one JSON object per request; None for none.
        access_log_bytes, access_log_files: Size at which the log is rotated, and how many old ones are kept.
        metrics_folder: Folder that the workers share for ``/metrics``; None where there is one worker.
    """

    host: str = "127.0.0.1"
    port: int = 5001
    workers: int = 1
    max_body_bytes: int = 32 * MIB
    max_rows: int = 200_000
    timeout_s: float = 30.0
    max_concurrent: int = 16
    max_memory_bytes: int = 2048 * MIB
    access_log: Path | None = None
    access_log_bytes: int = 64 * MIB
    access_log_files: int = 5
    metrics_folder: Path | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be served.

        Raises:
            ServingError: A limit is not positive.
            AccessError: TLS is half given, or the host is public without tokens.
        """
        if not 0 <= self.port <= 65535:
            raise ServingError(f"port: got {self.port}, expected 0 to 65535")
        limits = ("workers", "max_body_bytes", "max_rows", "timeout_s", "max_concurrent", "max_memory_bytes")
        for name in (*limits, "access_log_bytes", "access_log_files"):
            if not getattr(self, name) > 0:
                raise ServingError(f"{name}: got {getattr(self, name)}, expected more than 0")
        self.refuse_exposed(self.host)

    def to_json(self) -> str:
        """Return the settings as JSON, for a worker process."""
        return json.dumps(asdict(self), default=str)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Return what ``to_json`` wrote."""
        given: dict[str, Any] = json.loads(text)
        paths = {field.name for field in fields(cls) if field.type == Path | None}
        return cls(**given | {key: Path(given[key]) for key in paths if given[key]})
