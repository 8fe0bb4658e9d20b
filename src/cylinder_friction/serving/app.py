"""The ASGI application: routes, limits and errors of the served model."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib import metadata
from pathlib import Path

import orjson
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from cylinder_friction.deployment.scoring import ScoringError, score_columns
from cylinder_friction.serving.model_source import ModelSource
from cylinder_friction.serving.settings import ServeSettings

POLL_S = 1.0
_log = logging.getLogger(__name__)


def create_app(settings: ServeSettings, current_model_file: Path) -> Starlette:
    """Return the application of one worker; it serves the model that ``current_model_file`` names, as it changes.

    Raises:
        ServingError: That model cannot be served.
    """
    source = ModelSource(current_model_file)

    async def invocations(request: Request) -> Response:
        body = await request.body()
        if len(body) > settings.max_body_bytes:
            return _json({"error_code": "REQUEST_ENTITY_TOO_LARGE", "message": "the body is too large"}, 413)
        split = orjson.loads(body)["dataframe_split"]
        try:
            columns = dict(zip(split["columns"], zip(*split["data"], strict=True), strict=True))
            scored = {name: values.tolist() for name, values in score_columns(source.now.graph, columns).items()}
        except ScoringError as error:
            return _json({"error_code": "UNPROCESSABLE_ENTITY", "message": str(error)}, 422)
        rows = (dict(zip(scored, row, strict=True)) for row in zip(*scored.values(), strict=True))
        return _json({"predictions": list(rows)})

    async def livez(_: Request) -> Response:
        return Response("\n", media_type="application/json")

    async def version(_: Request) -> Response:
        return Response(metadata.version("mlflow"), media_type="application/json")

    async def readyz(_: Request) -> Response:
        now = source.now
        return _json(
            {
                "model": now.model.name,
                "version": now.model.version,
                "golden_difference_n": now.golden_difference_n,
                "problem": source.problem or None,
            }
        )

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        watch = asyncio.create_task(_watch(source))
        yield
        watch.cancel()

    routes = [
        Route("/invocations", invocations, methods=["POST"]),
        Route("/readyz", readyz),
        Route("/version", version),
    ]
    routes += [Route(path, livez) for path in ("/livez", "/ping", "/health")]
    return Starlette(routes=routes, lifespan=lifespan)


async def _watch(source: ModelSource) -> None:
    while True:
        await asyncio.sleep(POLL_S)
        await asyncio.to_thread(source.refresh)


def _json(content: object, status: int = 200) -> Response:
    return Response(orjson.dumps(content), status, media_type="application/json")
