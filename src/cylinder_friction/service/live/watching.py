"""What the page is sent: a row of each session some times a second, and one session's samples in full."""

import asyncio
import json
import time
from collections.abc import Mapping
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from cylinder_friction.realtime.flags import Flag
from cylinder_friction.service.live.engine import Engine
from cylinder_friction.service.live.frames import EstimateBlock
from cylinder_friction.service.live.service import LiveService, LiveSession
from cylinder_friction.service.live.stribeck import Lines

TICK_S = 0.2
UNSENT_BLOCKS = 2000
"""A page that reads no faster loses what is beyond this; the journal loses nothing."""


class Watchers:
    """All open pages.

    Args:
        service: Whose sessions they show.
        stribeck: Curves that they draw beside the estimates.
    """

    def __init__(self, service: LiveService, stribeck: Lines | None = None) -> None:
        self._service = service
        self._first = json.dumps({"stribeck": stribeck or {}, "flags": [flag.name for flag in Flag]})
        self._pages: set[_Page] = set()
        self._by_session: dict[str, set[_Page]] = {}

    def _note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Remember the estimates of a session that a page looks at."""
        for page in self._by_session.get(session.name, ()):
            if len(page.blocks) < UNSENT_BLOCKS:
                page.blocks.append((block, session.unkept[-1].last_samples(len(block))))

    async def run(self, socket: WebSocket) -> None:
        """Serve a page, its socket accepted, until it leaves; it sends the name of the session shown, or nothing."""
        if len(self._pages) >= self._service.limits.connections:
            await socket.close(1013, f"{len(self._pages)} pages are open, all that are taken; try later")
            return
        page = _Page(socket)
        self._pages.add(page)
        if len(self._pages) == 1:
            self._service.takers.append(self._note)
        try:
            await socket.send_text(self._first)
            while True:
                self._look_at(page, (await socket.receive_text())[:80])
        except (WebSocketDisconnect, KeyError):
            pass
        finally:
            self._pages.discard(page)
            if not self._pages:
                self._service.takers.remove(self._note)
            self._look_at(page, "")

    async def tick(self) -> None:
        """Send every page what is new, again and again; a page that is still busy with the last is left out."""
        while True:
            await asyncio.sleep(TICK_S)
            if not self._pages:
                continue
            engine, now_s = self._service.engine, time.time()
            rows = [self._row(each, now_s) for each in self._service.sessions.values()]
            about = {"sample_time_s": engine.sample_time_s, "inputs": engine.inputs, "bounds": engine.bounds}
            table = json.dumps({"sessions": rows, **about})
            for page in self._pages:
                if page.sending is None or page.sending.done():
                    page.sending = asyncio.create_task(page.send(table, self._service.engines))

    def _look_at(self, page: "_Page", name: str) -> None:
        for looking in self._by_session.values():
            looking.discard(page)
        page.blocks.clear()
        if name in self._service.sessions:
            self._by_session.setdefault(name, set()).add(page)

    def _row(self, session: LiveSession, now_s: float) -> dict[str, Any]:
        last = None if session.latest is None else session.latest.last(session.order.sample_time_s)
        return {
            "name": session.name,
            "index": session.next_index,
            "newtons": [0.0, 0.0, 0.0] if last is None else last.newtons,
            "flags": Flag.names(0 if last is None else last.flags),
            "lag_s": None if last is None else now_s - last.time_s,
            "kept": session.kept_index,
            "counts": vars(session.order.counts),
            "not_known": session.not_known,
        }


class _Page:
    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self.blocks: list[tuple[EstimateBlock, Any]] = []
        self.sending: asyncio.Task[None] | None = None

    async def send(self, table: str, engines: Mapping[str, Engine]) -> None:
        blocks, self.blocks = self.blocks, []
        try:
            await self._socket.send_text(table)
            if blocks:
                await self._socket.send_text(_detail(blocks, engines))
        except (RuntimeError, WebSocketDisconnect):
            pass  # it has left


def _detail(blocks: list[tuple[EstimateBlock, Any]], engines: Mapping[str, Engine]) -> str:
    columns: dict[str, list[Any]] = {"index": [], "samples": [], "newtons": [], "flags": []}
    for block, samples in blocks:
        columns["index"] += range(block.index, block.index + len(block))
        columns["samples"] += [[None if value != value else value for value in row] for row in samples.tolist()]
        columns["newtons"] += block.newtons.tolist()
        columns["flags"] += block.flags.tolist()
    model = blocks[-1][0].model
    return json.dumps({"rows": columns, "model": engines[model].called or model[:12]})
