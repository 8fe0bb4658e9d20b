"""Estimates as InfluxDB's line protocol, which most time-series databases read: by HTTP, or as a file per day.

A line is ``friction,session=press\\ 7 friction_n=...,lower_n=...,upper_n=...,flags=4i,index=1200i TIME``, its time the
sender's [ns], to the microsecond. A database that is away is tried again; what the queue cannot hold meanwhile is
dropped, oldest first, and counted: the history in Parquet has all of it.
"""

import asyncio
import logging
import urllib.error
import urllib.request
from collections import deque
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.service.links.link import Link
from cylinder_friction.service.live.connection import Peers
from cylinder_friction.service.live.frames import EstimateBlock
from cylinder_friction.service.live.service import LiveService, LiveSession
from cylinder_friction.service.live.settings import LineProtocolSettings, token_of

LONGEST_RETRY_S, TIMEOUT_S, LAST_S = 30.0, 2.0, 1.5
_NOT_LINES = (400, 413, 422)
"""Replies to lines that a database will take no better the next time."""
_ESCAPED = str.maketrans({",": "\\,", " ": "\\ ", "=": "\\="})
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SessionRows:
    """Estimates of one session that wait, evenly spaced."""

    session: str
    index: int  # Of the first
    stride: int  # Between two rows
    time_s: float
    sample_time_s: float
    newtons: Array  # Shape ``(rows, 3)``
    flags: NDArray[np.uint32]


def lines_of(rows: SessionRows, measurement: str) -> str:
    """Return one line per row, each with its end."""
    series = f"{measurement.translate(_ESCAPED)},session={rows.session.translate(_ESCAPED)}"
    numbered = enumerate(zip(rows.newtons.tolist(), rows.flags.tolist(), strict=True))
    return "".join(
        f"{series} friction_n={friction!r},lower_n={lower!r},upper_n={upper!r},flags={flags}i,"
        f"index={rows.index + place * rows.stride}i "
        f"{1000 * round(1e6 * (rows.time_s + place * rows.stride * rows.sample_time_s))}\n"
        for place, ((friction, lower, upper), flags) in numbered
    )


class LineProtocolLink(Link):
    """Collects rows on the event loop; formats and sends them in a thread."""

    name: ClassVar[str] = "line_protocol"

    def __init__(self, settings: LineProtocolSettings) -> None:
        super().__init__((settings.url or settings.folder or "").partition("?")[0])
        self._settings = settings
        self._token = token_of(settings.token_file)
        self._waiting: deque[SessionRows] = deque()
        self._waiting_rows = 0
        self._stop = asyncio.Event()

    def note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Keep the rows whose turn it is by their index; beyond the queue the oldest are dropped."""
        sample_time_s, rows_hz = session.order.sample_time_s, self._settings.rows_hz
        stride = max(1, round(1.0 / (rows_hz * sample_time_s))) if rows_hz else 1
        first = -block.index % stride
        flags = block.flags[first::stride]
        if not len(flags):
            return
        time_s = block.time_s + first * sample_time_s
        newtons = block.newtons[first::stride]
        self._waiting.append(
            SessionRows(session.name, block.index + first, stride, time_s, sample_time_s, newtons, flags)
        )
        self._waiting_rows += len(flags)
        while self._waiting_rows > self._settings.queue_rows:
            self.counts["dropped"] += self._taken_first()[1]

    @asynccontextmanager
    async def running(self, service: LiveService, peers: Peers) -> AsyncIterator[None]:  # noqa: ARG002 - nobody comes in
        """Send whenever there are rows; at the end what is left, for a moment."""
        sending = asyncio.create_task(self._send_all())
        try:
            yield
        finally:
            self._stop.set()
            with suppress(TimeoutError):
                async with asyncio.timeout(LAST_S):
                    await sending
            self.counts["dropped"] += self._waiting_rows

    async def _send_all(self) -> None:
        pause_s = self._settings.flush_s
        while not self._stop.is_set():
            with suppress(TimeoutError):
                async with asyncio.timeout(pause_s):
                    await self._stop.wait()
            sent = await self._send_waiting()
            pause_s = self._settings.flush_s if sent else min(2.0 * pause_s, LONGEST_RETRY_S)

    async def _send_waiting(self) -> bool:
        """Send all that waits; return False where it has to be tried again."""
        while batch := self._batch():
            if not await asyncio.to_thread(self._sent, batch):
                self._waiting.extendleft(reversed(batch))
                self._waiting_rows += sum(len(each.flags) for each in batch)
                self.counts["retries"] += 1
                return False
        return True

    def _batch(self) -> list[SessionRows]:
        batch, rows = [], 0
        while self._waiting and rows < self._settings.batch_rows:
            first, count = self._taken_first()
            batch.append(first)
            rows += count
        return batch

    def _taken_first(self) -> tuple[SessionRows, int]:
        first = self._waiting.popleft()
        self._waiting_rows -= len(first.flags)
        return first, len(first.flags)

    def _sent(self, batch: Sequence[SessionRows]) -> bool:
        """Return whether a batch needs no other try; runs in a thread."""
        rows = sum(len(each.flags) for each in batch)
        try:
            if self._settings.folder is not None:
                self._append(Path(self._settings.folder), batch)
            else:
                self._post("".join(lines_of(each, self._settings.measurement) for each in batch).encode())
        except urllib.error.HTTPError as error:
            with error:
                reason = error.read(200).decode(errors="replace").strip()
            _log.warning("line protocol, %s: %d %s", self.address, error.code, reason)
            self.counts["refused"] += rows if error.code in _NOT_LINES else 0
            return error.code in _NOT_LINES
        except OSError as error:
            _log.warning("line protocol, %s: %s", self.address, error)
            return False
        self.counts["rows"] += rows
        return True

    def _append(self, folder: Path, batch: Sequence[SessionRows]) -> None:
        by_day: dict[str, list[str]] = {}
        for rows in batch:
            day = str(np.datetime64(int(rows.time_s), "s").astype("datetime64[D]"))
            by_day.setdefault(day, []).append(lines_of(rows, self._settings.measurement))
        folder.mkdir(parents=True, exist_ok=True)
        for day, lines in by_day.items():
            with (folder / f"{day}.lp").open("a", encoding="utf-8") as file:
                file.write("".join(lines))

    def _post(self, content: bytes) -> None:
        head = {"Content-Type": "text/plain; charset=utf-8"}
        if self._token is not None:
            head["Authorization"] = f"Token {self._token}"
        request = urllib.request.Request(self._settings.url or "", content, head)  # noqa: S310 - settings allow http(s)
        urllib.request.urlopen(request, timeout=TIMEOUT_S).close()  # noqa: S310 - the same
