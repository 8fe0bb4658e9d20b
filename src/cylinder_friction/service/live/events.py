"""What happens to sessions and connections, as JSON lines for those who run the service."""

import asyncio
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cylinder_friction.service.json_log import JsonLog, rotate
from cylinder_friction.service.live.service import LiveService

LOG_BYTES, LOG_FILES = 64 << 20, 5
"""Size at which the log is rotated, and how many old files are kept."""


class Events:
    """Writes one line per event, and none where there is no file.

    Raises:
        OSError: The file cannot be written.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path, self._log = path, None if path is None else JsonLog(path)

    def note(self, event: str, **fields: Any) -> None:
        """Write an event with what is known of it."""
        if self._log is not None:
            time = datetime.now(UTC).isoformat(timespec="milliseconds")
            self._log.write({"time": time, "event": event, **fields})

    async def watch(self, service: LiveService) -> None:
        """Note each second which sessions began anew and how late the loop was, and rotate the file."""
        resets: dict[str, int] = {}
        named: set[str] = set()  # Sessions whose model does not know them, and that were named
        while self._path is not None:
            before, resets = resets, {name: each.order.counts.resets for name, each in service.sessions.items()}
            for name, count in resets.items():
                if count > before.get(name, count):
                    self.note("session reset", session=name, skipped=service.sessions[name].order.counts.skipped)
            for each in service.sessions.values():
                if each.name not in named and (words := each.not_known):
                    named.add(each.name)
                    self.note("estimates not to be used as they are", session=each.name, because=words)
            if service.loop_lag_s > service.limits.loop_lag_s:
                self.note("slow loop", seconds=round(service.loop_lag_s, 3), **service.load())
            await asyncio.to_thread(rotate, self._path, LOG_BYTES, LOG_FILES)
            await asyncio.sleep(1.0)
