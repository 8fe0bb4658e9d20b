"""Messages to the page: a row of each session a few times a second, and all samples of one session."""

import asyncio
import json
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from cylinder_friction.realtime.flags import Flag
from cylinder_friction_live.frames import EstimateBlock
from cylinder_friction_live.history import last_rows
from cylinder_friction_live.service import LiveService, LiveSession
from cylinder_friction_live.stribeck import Lines

TICK_S = 0.2
RECENT_S = 60.0
"""Duration of earlier estimates that a page gets when it selects a session [s]."""
UNSENT_BLOCKS = 2000
"""Most unsent blocks of a page; a slower page loses the rest, and the journal loses nothing."""


class Watchers:
    """All open pages.

    Args:
        service: The service with the sessions.
        stribeck: Curves that the pages draw beside the estimates.
    """

    def __init__(self, service: LiveService, stribeck: Lines | None = None) -> None:
        self._service = service
        flags = [{"name": flag.name, "meaning": flag.meaning, "advice": flag.advice} for flag in Flag]
        self._first = json.dumps({"stribeck": stribeck or {}, "flags": flags})
        self._pages: set[_Page] = set()
        self._by_session: dict[str, set[_Page]] = {}

    def _note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Queue the estimates of a session for the pages that show it."""
        for page in self._by_session.get(session.name, ()):
            if not page.has_begun:  # it selected the session before it was open, as after a restart
                page.begin(self._service.recent(session, self._recent_rows))
            elif len(page.blocks) < UNSENT_BLOCKS:
                page.blocks.append((block, session.pending[-1].newest_samples(len(block))))

    async def run(self, socket: WebSocket) -> None:
        """Serve a page with an accepted socket until it disconnects; it sends the name of a session to select it."""
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
                await self._select_session(page, (await socket.receive_text())[:80])
        except (WebSocketDisconnect, KeyError):
            pass
        finally:
            self._pages.discard(page)
            if not self._pages:
                self._service.takers.remove(self._note)
            self._leave(page)

    async def tick(self) -> None:
        """Send news to all pages repeatedly; a page that is still busy with the last message is left out."""
        while True:
            await asyncio.sleep(TICK_S)
            if not self._pages:
                continue
            engine, now_s = self._service.engine, time.time()
            rows = [self._row(each, now_s) for each in self._service.sessions.values()]
            about = {name: getattr(engine, name) for name in ("sample_time_s", "inputs", "bounds", "corrections")}
            table = json.dumps({"sessions": rows, **about})
            for page in self._pages:
                if page.sending is None or page.sending.done():
                    page.sending = asyncio.create_task(page.send(table, {engine.model: engine.called}))

    @property
    def _recent_rows(self) -> int:
        return round(RECENT_S / self._service.engine.sample_time_s)

    async def _select_session(self, page: "_Page", name: str) -> None:
        self._leave(page)
        if not name:
            return
        looking = self._by_session.setdefault(name, set())
        looking.add(page)
        session = self._service.sessions.get(name)
        if session is None:
            return
        recent, rows = self._service.recent(session, self._recent_rows), self._recent_rows
        before, missing = recent[0][0].index if recent else None, rows - sum(len(each) for each, _ in recent)
        last = None
        if missing > 0:  # of the history the journal holds only the last ten seconds
            inputs = self._service.engine.inputs
            with suppress(OSError, ValueError):  # files that are being joined, or are damaged
                last = await asyncio.to_thread(last_rows, self._service.journal.history, name, inputs, missing, before)
        if page in looking:
            page.begin([*([last] if last else []), *self._service.recent(session, rows)])

    def _leave(self, page: "_Page") -> None:
        for name, looking in list(self._by_session.items()):
            looking.discard(page)
            if not looking:
                del self._by_session[name]
        page.blocks, page.has_begun = [], False

    def _row(self, session: LiveSession, now_s: float) -> dict[str, Any]:
        last = session.latest
        return {
            "name": session.name,
            "index": session.next_index,
            "newtons": None if last is None else last.newtons,
            "flags": Flag.names(0 if last is None else last.flags),
            "lag_s": None if last is None else now_s - last.time_s,
            "rest_s": self._service.now_s - session.order.last_seen_s,
            "ended": session.owner is None,
            "kept": session.kept_index,
            "counts": vars(session.order.counts),
            "not_known": session.not_known,
            "too_narrow": session.too_narrow,
        }


class _Page:
    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self.blocks: list[tuple[EstimateBlock, Any]] = []
        self.has_begun = self._begins = False
        self.sending: asyncio.Task[None] | None = None

    def begin(self, blocks: list[tuple[EstimateBlock, Any]]) -> None:
        """Replace the page's rows by these, and continue with later ones."""
        self.blocks, self.has_begun, self._begins = blocks, True, True

    async def send(self, table: str, called: Mapping[str, str]) -> None:
        blocks, self.blocks = self.blocks, []
        begins, self._begins = self._begins and bool(blocks), self._begins and not blocks
        try:
            await self._socket.send_text(table)
            if blocks:
                # in a thread: a minute of rows takes some hundredths of a second
                detail = await asyncio.to_thread(_detail, blocks, called, True) if begins else _detail(blocks, called)
                await self._socket.send_text(detail)
        except (RuntimeError, WebSocketDisconnect):
            pass  # the page has disconnected


def _detail(blocks: list[tuple[EstimateBlock, Any]], called: Mapping[str, str], begins: bool = False) -> str:
    columns: dict[str, list[Any]] = {"index": [], "samples": [], "newtons": [], "flags": []}
    for block, samples in blocks:
        columns["index"] += range(block.index, block.index + len(block))
        columns["samples"] += [[None if value != value else value for value in row] for row in samples.tolist()]
        columns["newtons"] += block.newtons.tolist()
        columns["flags"] += block.flags.tolist()
    model = blocks[-1][0].model
    return json.dumps({"rows": columns, "begins": begins, "model": called.get(model) or model[:12]})
