"""The service on the network: WebSocket in and out, a page, health and metrics."""

import asyncio
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from importlib import import_module
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from cylinder_friction_live.access import Access
from cylinder_friction_live.connection import ClientGoneError, Connection, Peers
from cylinder_friction_live.events import Events
from cylinder_friction_live.guard import AccessControl, client_of
from cylinder_friction_live.history import move_into_history
from cylinder_friction_live.keeping import Job, keep_each_second, keep_running, keep_some, move_each_minute
from cylinder_friction_live.links.link import Link, in_background
from cylinder_friction_live.server import ANSWERING
from cylinder_friction_live.service import LiveService
from cylinder_friction_live.stribeck import Lines
from cylinder_friction_live.watching import Watchers

OVERDUE_S, REFRESH_S = 0.05, 1.0
LAST_WORD_S, LAST_MOVES_S = 0.3, 0.5
"""Time at the end for clients to read their last acknowledgements, and to move the journal into the history [s]."""
STATIC = Path(__file__).parent / "static"


def create_app(
    service: LiveService,
    links: Sequence[Link] = (),
    access: Access | None = None,
    host: str = "127.0.0.1",
    events: Events | None = None,
    stribeck: Lines | None = None,
) -> Starlette:
    """Build the application around a service.

    ``stribeck`` are curves for its page. ``links`` start and end with the application. ``app.state.drain`` accepts no
    more messages, and keeps and acknowledges those that came.

    Raises:
        AccessError: The tokens cannot be read.
    """
    events = events or Events()
    peers, watchers = Peers(events), Watchers(service, stribeck)
    guard = AccessControl(access or Access(), host, peers.refused, events)
    service.takers += [link.note for link in links]

    async def drain() -> None:
        peers.draining = True
        await keep_some(service, peers, list(service.sessions.values()))
        await peers.sent(LAST_WORD_S)

    async def stream(socket: WebSocket) -> None:
        connection = Connection(WebSocketTransport(socket), service, peers, client_of(socket), guard.user_of(socket))
        socket.scope["extensions"][ANSWERING]["protocol"].answer = connection.answer
        await guard.serve(socket, "write", connection.run)

    async def watch(socket: WebSocket) -> None:
        await guard.serve(socket, "read", partial(watchers.run, socket))

    async def readyz(_: Request) -> Response:
        well = not service.keeps_not_because and not service.ended_jobs
        full = peers.full(service.limits) or service.full
        ready = service.loop_lag_s < 1.0 and well and not peers.draining and not full
        body = {
            "ready": ready,
            "ending": peers.draining,
            "full": full,
            "not_kept": service.keeps_not_because,
            "ended_jobs": service.ended_jobs,
            "tokens": "" if guard.tokens is None else guard.tokens.problem,
            "not_in_history": service.not_in_history,
            "model": service.engine.model,
            "called": service.engine.called,
            "golden_difference_n": service.engine.golden_difference_n,
            "loop_lag_s": service.loop_lag_s,
            **service.load(),
        }
        return JSONResponse(body, 200 if ready else 503)

    async def metrics(_: Request) -> Response:
        # Imported late: its library takes a tenth of a start's imports, and samples would wait for it
        loaded = await asyncio.to_thread(import_module, "cylinder_friction_live.metrics")
        return PlainTextResponse(loaded.metrics_text(service, peers, links), media_type="text/plain; version=0.0.4")

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        async with AsyncExitStack() as started:
            jobs: dict[str, Job] = {
                "keeping": partial(keep_each_second, service, peers),
                "history": partial(move_each_minute, service),
                "gaps": partial(_overdue, service),
                "page": watchers.tick,
                "tokens": partial(_refresh, guard),
                "events": partial(events.watch, service),
            }
            await started.enter_async_context(
                in_background(*(keep_running(service, name, job) for name, job in jobs.items()))
            )
            for link in links:
                await started.enter_async_context(link.running(service, peers))
            yield
        move_into_history(service.journal, within_s=LAST_MOVES_S)
        events.close()

    app = Starlette(
        routes=[
            Route("/", lambda _: FileResponse(STATIC / "live.html")),
            Route("/livez", lambda _: PlainTextResponse("alive\n")),
            Route("/readyz", readyz),
            Route("/metrics", guard.http("read", metrics)),
            WebSocketRoute("/stream", stream),
            WebSocketRoute("/watch", watch),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        lifespan=lifespan,
    )
    app.state.drain = drain
    return app


class _Lag:
    """Greatest delay of the event loop within the last second."""

    def __init__(self) -> None:
        self.worst_s, self._next_s, self._since_s = 0.0, 0.0, time.monotonic()

    def note(self, late_s: float) -> float:
        self._next_s = max(self._next_s, late_s)
        if time.monotonic() - self._since_s > 1.0:
            self.worst_s, self._next_s, self._since_s = self._next_s, 0.0, time.monotonic()
        return self.worst_s


async def _overdue(service: LiveService) -> None:
    lag = _Lag()
    while True:
        due_s = time.monotonic() + OVERDUE_S
        await asyncio.sleep(OVERDUE_S)
        service.loop_lag_s = lag.note(time.monotonic() - due_s)
        service.overdue()


async def _refresh(guard: AccessControl) -> None:
    while True:
        await asyncio.sleep(REFRESH_S)
        guard.refresh()


class WebSocketTransport:
    """Messages of an accepted WebSocket."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket

    async def receive(self) -> bytes | str:
        """Wait for the next message; raises ``ClientGoneError``."""
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise ClientGoneError
        content: bytes | None = message.get("bytes")
        return content if content is not None else message.get("text") or ""

    async def send(self, message: bytes | str) -> None:
        """Send a message; raises ``ClientGoneError``."""
        try:
            if isinstance(message, bytes):
                await self._socket.send_bytes(message)
            else:
                await self._socket.send_text(message)
        except (WebSocketDisconnect, RuntimeError) as error:
            raise ClientGoneError from error
