"""Events of sessions and connections, as JSON lines for operators of the service."""

import asyncio
import json
import logging
import sys
from contextlib import suppress
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Any

from cylinder_friction_live.service import LiveService

LOG_BYTES, LOG_FILES = 64 << 20, 5
"""Size at which the log is rotated [bytes], and number of old files that are kept."""
_log = logging.getLogger(__name__)


class _EventFile(RotatingFileHandler):
    """A log file that ignores a full disk, so that the service continues."""

    _said = False

    def handleError(self, _record: logging.LogRecord) -> None:  # noqa: N802 - its base's name
        """Report once that lines are missing."""
        if not self._said:
            self._said = True
            _log.error("%s: nothing is logged (%s)", self.baseFilename, sys.exc_info()[1])


class Events:
    """Writes one line per event, if there is a file.

    Raises:
        OSError: The file cannot be written.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._file = None if path is None else _EventFile(path, maxBytes=LOG_BYTES, backupCount=LOG_FILES)

    def note(self, event: str, **fields: Any) -> None:
        """Write an event with its details."""
        if self._file is not None:
            time = datetime.now(UTC).isoformat(timespec="milliseconds")
            line = json.dumps({"time": time, "event": event, **fields}, separators=(",", ":"))
            self._file.handle(logging.LogRecord(__name__, logging.INFO, "", 0, line, None, None))

    def close(self) -> None:
        """Close the file; later events are dropped."""
        file, self._file = self._file, None
        if file is not None:
            with suppress(OSError):  # a full disk was reported already
                file.close()

    async def watch(self, service: LiveService) -> None:
        """Write each second which sessions began anew, and the delay of the event loop."""
        resets: dict[str, int] = {}
        named: set[tuple[str, str]] = set()  # Remarks on a session's model that were written, with the session
        while self._file is not None:
            before, resets = resets, {name: each.order.counts.resets for name, each in service.sessions.items()}
            for name, count in resets.items():
                if count > before.get(name, count):
                    self.note("session reset", session=name, skipped=service.sessions[name].order.counts.skipped)
            for each in service.sessions.values():
                seen = {"estimates not to be used as they are": each.not_known, "bounds too narrow": each.too_narrow}
                for event, words in seen.items():
                    if words and (event, each.name) not in named:
                        named.add((event, each.name))
                        self.note(event, session=each.name, because=words)
            if service.loop_lag_s > service.limits.loop_lag_s:
                self.note("slow loop", seconds=round(service.loop_lag_s, 3), **service.load())
            await asyncio.sleep(1.0)
