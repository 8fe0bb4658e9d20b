"""Commands on a running service: let a model run beside the present one, take over, go back, end."""

import asyncio
import re
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from cylinder_friction.service.guard import client_of
from cylinder_friction.service.live.connection import Peers
from cylinder_friction.service.live.engine import Engine, checked_engine
from cylinder_friction.service.live.service import LiveError, LiveService, LiveSession

KEPT_WITHIN_S = 5.0
LARGEST_BODY = 1 << 20
_ENGINE = re.compile(r"[0-9a-f]{32}")


class Command(BaseModel):
    """Body of ``POST /models``.

    Attributes:
        do: ``beside``: let the engine's model run beside the present one, and take over if ``after_s`` or ``at_index``
            is given; ``take-over``: let both change places, which is also the way back; ``end``: stop the second one.
        engine: Name of its folder below the service's ``engines``.
        recorded: Whether the second model's newtons are kept beside the first's.
        after_s: How long it runs beside before it takes over [s].
        at_index: From which sample on it takes over, in every session.
        sessions: Names; None: all that are open, and those that are opened later.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    do: Literal["beside", "take-over", "end"]
    engine: str | None = None
    recorded: bool = False
    after_s: float | None = Field(default=None, ge=0.0, le=1e9)
    at_index: int | None = Field(default=None, ge=0, lt=1 << 53)
    sessions: tuple[str, ...] | None = None

    @property
    def takes_over(self) -> bool:
        """Whether the engine's model is to give the newtons at some time."""
        return self.after_s is not None or self.at_index is not None


def giving_newtons(service: LiveService) -> dict[str, dict[str, Any]]:
    """Return the models that give newtons, that of new sessions included: in how many sessions, and how checked."""
    sessions = Counter({service.engine.model: 0})
    sessions.update(session.model for session in service.sessions.values())
    found = {}
    for model, count in sessions.items():
        golden_n = service.engines[model].golden_difference_n
        golden = "none is in the model's folder" if golden_n is None else "met"
        found[model] = {
            "called": service.engines[model].called,
            "sessions": count,
            "golden_trajectory": golden,
            "golden_difference_n": golden_n,
        }
    return found


class Changing:
    """The resource ``/models``.

    Args:
        service: Whose sessions change.
        engines: Folder in which ``built_engine`` puts engines.
        peers: State whether the service is ending; its events are given changes.
    """

    def __init__(self, service: LiveService, engines: Path, peers: Peers) -> None:
        self._service, self._engines, self._peers = service, engines, peers

    async def status(self, _: Request) -> Response:
        """Reply with the models that are known, and how many sessions run which."""
        runs, beside = Counter[str](), Counter[str]()
        for session in self._service.sessions.values():
            runs[session.model] += 1
            if session.models.shadow is not None:
                beside[session.models.shadow.engine.model] += 1
        models = {
            model: {
                "called": engine.called,
                "bounds": engine.bounds,
                "gives_newtons": runs[model],
                "runs_beside": beside[model],
            }
            for model, engine in self._service.engines.items()
        }
        return JSONResponse({"model_of_new_sessions": self._service.engine.model, "models": models})

    async def command(self, request: Request) -> Response:
        """Do what a body asks for; reply when it is kept, so that a restart knows it."""
        if self._peers.draining:
            return JSONResponse({"error": "the service is ending, nothing is changed; ask the one that follows"}, 503)
        try:
            command = Command.model_validate_json(await _body(request))
            engine = await asyncio.to_thread(self._engine, command.engine or "") if command.do == "beside" else None
            sessions = self._do(command, engine)
        except (ValidationError, LiveError) as error:
            return JSONResponse({"error": _explained(error) if isinstance(error, ValidationError) else str(error)}, 422)
        named = {} if engine is None else {"model": engine.model, "called": engine.called}
        client, count = client_of(request), len(sessions)
        self._peers.events.note("models changed", do=command.do, sessions=count, client=client, **named)
        waits_s = 0.0
        while not all(each.models.switch_kept for each in sessions):
            await asyncio.sleep(0.05)
            waits_s += 0.05
            if waits_s > KEPT_WITHIN_S:
                return JSONResponse({"error": "asked for, but not kept yet; see /readyz"}, 503)
        return JSONResponse({"sessions": count})

    def _do(self, command: Command, engine: Engine | None) -> list[LiveSession]:
        sessions, runs = self._asked_for(command.sessions), None
        if engine is not None:
            sessions = self._beside(command, engine, sessions)
            if command.takes_over:
                runs = [engine.model]
        elif command.do == "end":
            sessions = [session for session in sessions if session.models.switch is not None]
            if not sessions:
                raise LiveError("no second model runs in any session that was asked for; nothing is changed")
            for session in sessions:
                session.models.end_shadow()
            runs = [session.model for session in sessions]
        else:
            self._take_over(sessions, lambda session: command.at_index or session.next_index)
            runs = [session.models.switch.model for session in sessions if session.models.switch is not None]
        if runs and command.sessions is None:  # so do sessions that are opened later
            ((model, _),) = Counter(runs).most_common(1)
            self._service.engine = self._service.engines[model]
        return sessions

    def _beside(self, command: Command, engine: Engine, sessions: list[LiveSession]) -> list[LiveSession]:
        self._service.add_model(engine)
        changed = [session for session in sessions if session.model != engine.model]
        for_later = command.takes_over and command.sessions is None and self._service.engine.model != engine.model
        if not changed and not for_later:
            raise LiveError(
                f"model {engine.model[:12]}: no session that was asked for has another one; nothing is changed "
                "(`cylinder-friction switch --end` stops a model that runs beside)"
            )
        for session in changed:
            session.models.run_beside(engine.model, session.next_index, command.recorded)
        if command.takes_over:
            rows = round((command.after_s or 0.0) / engine.sample_time_s)
            self._take_over(changed, lambda session: command.at_index or session.models.begins_at + rows)
        return changed

    def _take_over(self, sessions: Iterable[LiveSession], index_of: Callable[[LiveSession], int]) -> None:
        without = [session.name for session in sessions if session.models.switch is None]
        if without:
            raise LiveError(
                f"session {without[0]!r}: no second model runs in it; bring one in by `cylinder-friction switch MODEL`"
            )
        for session in sessions:
            session.models.take_over(index_of(session))

    def _asked_for(self, names: tuple[str, ...] | None) -> list[LiveSession]:
        if names is None:
            return list(self._service.sessions.values())
        unknown = [name for name in names if name not in self._service.sessions]
        if unknown:
            raise LiveError(f"session {unknown[0][:80]!r}: not open")
        return [self._service.sessions[name] for name in names]

    def _engine(self, name: str) -> Engine:
        folder = self._engines / name
        if not _ENGINE.fullmatch(name) or not folder.is_dir():
            raise LiveError(
                f"engine {name[:80]!r}: not in {self._engines}; `cylinder-friction switch`, called on the service's "
                "machine with its --folder, puts it there"
            )
        try:
            return checked_engine(folder)
        except (OSError, ValueError, KeyError) as error:
            raise LiveError(f"engine {name}: not taken into service ({error})") from error


async def _body(request: Request) -> bytes:
    parts, size = [], 0
    async for part in request.stream():
        parts.append(part)
        size += len(part)
        if size > LARGEST_BODY:
            raise LiveError(f"got more than {LARGEST_BODY} bytes; expected a command")
    return b"".join(parts)


def _explained(error: ValidationError) -> str:
    problem = error.errors()[0]
    return f"{'.'.join(map(str, problem['loc'])) or 'body'}: {problem['msg']}, but got {str(problem['input'])[:80]!r}"
