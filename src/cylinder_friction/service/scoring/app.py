"""The ASGI application of the served model: its routes, and how a request is scored."""

import asyncio
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import orjson
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Route

from cylinder_friction.deployment.scoring import ScoringError, score_columns
from cylinder_friction.realtime.flags import Flag, unknown_in_words
from cylinder_friction.service.access import TokenFile
from cylinder_friction.service.json_log import JsonLog
from cylinder_friction.service.scoring.decoding import ARROW, JSON, decoder_of, refuse_too_many
from cylinder_friction.service.scoring.errors import RETRY, Columns, Expected, RequestError
from cylinder_friction.service.scoring.gate import Gate
from cylinder_friction.service.scoring.json_forms import to_json
from cylinder_friction.service.scoring.metrics import Metrics
from cylinder_friction.service.scoring.model_source import ModelSource
from cylinder_friction.service.scoring.openapi import openapi, page
from cylinder_friction.service.scoring.settings import ServeSettings

POLL_S = 1.0
UNUSABLE = "X-Not-To-Be-Used"
"""Header of a reply whose estimates are not to be used as they are; its value is the reason."""
SMALL_BYTES = 32 << 10
"""JSON up to this size is scored at once, in a few milliseconds: handing it to a thread would take longer."""


def create_app(settings: ServeSettings, current_model_file: Path) -> Starlette:
    """Return the application of one worker; it serves the model that ``current_model_file`` names, as it changes.

    Raises:
        ServingError: That model cannot be served, or the tokens cannot be read.
    """
    tokens = TokenFile(settings.tokens) if settings.tokens else None
    service = Service(settings, ModelSource(current_model_file), tokens)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        watch = asyncio.create_task(_watch(service, tokens))
        yield
        watch.cancel()

    routes = [Route("/invocations", service.invocations, methods=["POST"])]
    routes += [Route(path, service.livez) for path in ("/livez", "/ping", "/health")]
    routes += [Route("/readyz", service.readyz), Route("/version", _version), Route("/metrics", service.show_metrics)]
    routes += [Route("/openapi.json", service.show_openapi), Route("/docs", service.show_page)]
    log = JsonLog(settings.access_log) if settings.access_log else None
    gate = Middleware(Gate, service.metrics, tokens, log, frozenset(route.path for route in routes))
    return Starlette(
        routes=routes, middleware=[gate], lifespan=lifespan, exception_handlers={HTTPException: _refuse_route}
    )


class Service:
    """The model in service, and what the routes do with it."""

    def __init__(self, settings: ServeSettings, source: ModelSource, tokens: TokenFile | None) -> None:
        self.settings, self.source, self.tokens = settings, source, tokens
        self.metrics = Metrics(settings, source)
        self._pool = ThreadPoolExecutor(1, "scoring")  # one: what rows take while they are scored is bounded
        self._active = self._arriving_bytes = 0

    async def invocations(self, request: Request) -> Response:
        """Score rows; a request takes one of the places once its body has arrived, however slowly it does."""
        headers = request.headers
        if (encoding := headers.get("content-encoding", "identity")) != "identity":
            raise RequestError(
                415, f"Content-Encoding is {encoding[:80]}; expected none", {"Accept-Encoding": "identity"}
            )
        decode = decoder_of(headers.get("content-type"))
        body = await self._body(request)
        if self._active >= self.settings.max_concurrent:
            raise RequestError(429, f"{self._active} requests are being served; try again later", RETRY)
        self._active += 1
        self.metrics.active.inc()
        try:
            return await self._scored(request, decode, body)
        finally:
            self._active -= 1
            self.metrics.active.dec()

    async def _scored(self, request: Request, decode: Callable[[bytes, Expected], Columns], body: bytes) -> Response:
        headers = request.headers
        accepted = headers.get("accept", "")
        media = ARROW if ARROW in accepted or (ARROW in headers["content-type"] and JSON not in accepted) else JSON
        notes = request.scope["notes"]
        notes["bytes_in"] = len(body)

        def work() -> Response:
            return self._work(decode, body, media, notes)

        if len(body) <= SMALL_BYTES and headers["content-type"].startswith(JSON):
            return work()
        future = self._pool.submit(work)
        try:
            async with asyncio.timeout(self.settings.timeout_s):
                return await asyncio.wrap_future(future)
        except TimeoutError:
            raise RequestError(
                503, f"not scored within {self.settings.timeout_s:g} s; try again later", RETRY
            ) from None

    async def _body(self, request: Request) -> bytes:
        most = self.settings.max_body_bytes
        refused = RequestError(413, f"the body is larger than {most} bytes; send recordings one by one")
        if int(request.headers.get("content-length", 0)) > most:
            raise refused
        body, room = bytearray(), most * self.settings.max_concurrent
        try:
            async with asyncio.timeout(self.settings.timeout_s):
                async for chunk in request.stream():
                    body += chunk
                    self._arriving_bytes += len(chunk)
                    if len(body) > most:
                        raise refused
                    if self._arriving_bytes > room:
                        raise RequestError(429, "too many large bodies are arriving; try again later", RETRY)
        except TimeoutError:
            message = f"the body did not arrive within {self.settings.timeout_s:g} s"
            raise RequestError(408, message, {"Connection": "close"}) from None
        except ClientDisconnect:
            raise RequestError(400, "the client left before its body had arrived") from None
        finally:
            self._arriving_bytes -= len(body)
        return bytes(body)

    def _work(
        self, decode: Callable[[bytes, Expected], Columns], body: bytes, media: str, notes: dict[str, Any]
    ) -> Response:
        model = self.source.now  # one for the whole request, also where it is exchanged meanwhile
        try:
            columns = decode(body, Expected(model.graph.inputs, self.settings.max_rows))
            refuse_too_many(columns)
            scored = score_columns(model.graph, columns)
        except ScoringError as error:
            raise RequestError(422, str(error)) from None
        except RecursionError:
            raise RequestError(400, "the body is nested too deeply; expected rows of numbers") from None
        notes |= {"rows": len(scored["flags"]), "model_version": model.model.version}
        self.metrics.count_rows(scored["flags"], scored["in_training_range"])
        counts = {
            str(flag.name): int((scored["flags"] & flag != 0).sum()) for flag in (Flag.OUTSIDE, Flag.UNMODELLED_FORCE)
        }
        unusable = unknown_in_words(notes["rows"], counts)
        headers = {UNUSABLE: unusable} if unusable else None
        if media == JSON:
            return Response(to_json(scored), media_type=media, headers=headers)
        from cylinder_friction.service.scoring.tables import to_arrow  # pyarrow takes 40 MB, and JSON needs none

        return Response(to_arrow(scored), media_type=media, headers=headers)

    async def livez(self, _: Request) -> Response:
        """Respond as long as the worker runs."""
        return Response("\n", media_type=JSON)

    async def readyz(self, _: Request) -> Response:
        """State the model in service, and how it passed its golden trajectory."""
        now = self.source.now
        content = {
            "ready": True,
            "model": now.model.name,
            "version": now.model.version,
            "bounds": now.graph.bounds,
            "trained_for": now.graph.trained_for or None,
            "golden_trajectory": "met",
            "golden_difference_n": now.golden_difference_n,
            "refused": self.source.problem or None,
            "tokens": (self.tokens.problem if self.tokens else "") or None,
        }
        return Response(orjson.dumps(content), media_type=JSON)

    async def show_metrics(self, _: Request) -> Response:
        """Show the figures of all workers for Prometheus."""
        text, media = await asyncio.to_thread(self.metrics.text)
        return Response(text, media_type=media)

    async def show_openapi(self, _: Request) -> Response:
        """Describe the routes for programs."""
        return Response(orjson.dumps(openapi(self.source.now, self.settings)), media_type=JSON)

    async def show_page(self, _: Request) -> Response:
        """Describe the routes for people."""
        return HTMLResponse(page(openapi(self.source.now, self.settings)))


async def _version(_: Request) -> Response:
    """Respond with MLflow's version, as its server does."""
    return Response(metadata.version("mlflow"), media_type=JSON)


async def _refuse_route(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    paths = "expected POST /invocations; GET /docs lists all"
    raise RequestError(error.status_code, f"{error.detail}; {paths}", error.headers)


async def _watch(service: Service, tokens: TokenFile | None) -> None:
    while True:
        await asyncio.sleep(POLL_S)
        await asyncio.to_thread(service.source.refresh)
        service.metrics.observe_model()
        if tokens is not None:
            await asyncio.to_thread(tokens.refresh)
