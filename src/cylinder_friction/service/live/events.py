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
        named: set[tuple[str, str]] = set()  # What was noted of a session's model, and the session
        while self._path is not None:
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
            await asyncio.to_thread(rotate, self._path, LOG_BYTES, LOG_FILES)
            await asyncio.sleep(1.0)
