"""Results by OPC UA, from a process of its own: the library's work for a greedy client delays nobody else's newtons.

The service writes into the process's standard input what is new, as lines of JSON, and never waits for it. It ends with
the service, however that ends, for its input does.
"""

import asyncio
import json
import logging
import math
import os
import sys
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict
from functools import reduce
from importlib.util import find_spec
from operator import or_
from pathlib import Path

from cylinder_friction.service.access import ROLES
from cylinder_friction.service.links.link import AT_ONCE, Link, in_background
from cylinder_friction.service.live.connection import Peers
from cylinder_friction.service.live.frames import EstimateBlock
from cylinder_friction.service.live.journal import LastRow
from cylinder_friction.service.live.service import LiveService, LiveSession
from cylinder_friction.service.live.settings import OpcUaServerSettings, OpcUaValues

KEPT_S = 3600.0
"""So long an object stays after its session was closed."""
PATIENCE_S = 2.0
"""So long the port may still be held by the process of a service that was killed."""
NICENESS = 10
"""On a core that both want, the service goes first."""
RESTARTS_S = 1.0, 60.0
"""How long a process that has ended stays away: twice as long as before if it ran for less than the longest."""
_log = logging.getLogger(__name__)


class OpcUaServerLink(Link):
    """An OPC UA server beside a live service.

    Args:
        settings: Address, rate and certificate.
        tokens: File of the tokens, one of which is the password of each user; None: whoever reaches it may read.

    Raises:
        ModuleNotFoundError: Its library is not installed.
    """

    name = "opcua server"

    def __init__(self, settings: OpcUaServerSettings, tokens: Path | None = None) -> None:
        super().__init__(f"opc.tcp://{settings.host}:{settings.port}/")
        if find_spec("asyncua") is None:
            raise ModuleNotFoundError("No module named 'asyncua'", name="asyncua")
        given = {"address": self.address, "settings": asdict(settings), "tokens": tokens, "roles": ROLES}
        worker = "cylinder_friction.service.links.opcua_worker"
        self._command = (sys.executable, "-P", "-m", worker, json.dumps(given, default=str))
        self._settings = settings
        self._flags: dict[str, int] = {}  # Of all samples since a session was handed over last
        self._shown: dict[str, float] = {}  # Since when it is closed; infinity: it is open

    def note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Take flags for the next update."""
        self._flags[session.name] = reduce(or_, block.flags.tolist(), self._flags.get(session.name, 0))

    @asynccontextmanager
    async def running(self, service: LiveService, peers: Peers) -> AsyncIterator[None]:  # noqa: ARG002 - nobody comes in
        """Have a server, which listens a second or two later; raises ``OSError`` where it cannot."""
        for path in (self._settings.certificate, self._settings.private_key):
            if path is not None:
                path.open("rb").close()
        await self._refuse_taken_port()
        async with in_background(self._keep_going(service)):
            yield

    async def _refuse_taken_port(self) -> None:
        loop = asyncio.get_running_loop()
        until_s = loop.time() + PATIENCE_S
        while True:
            try:
                probe = await loop.create_server(
                    asyncio.Protocol, self._settings.host, self._settings.port, start_serving=False
                )
            except OSError:
                if loop.time() > until_s:
                    raise
                await asyncio.sleep(0.05)
            else:
                probe.close()
                return

    async def _keep_going(self, service: LiveService) -> None:
        shortest_s, longest_s = RESTARTS_S
        pause_s = shortest_s
        while True:
            began_s = time.monotonic()
            try:
                why = f"exit code {await self._run(service)}"
            except OSError as error:
                why = str(error)
            if time.monotonic() - began_s > longest_s:
                pause_s = shortest_s
            self.counts["restarted"] += 1
            _log.warning("%s: its process has ended (%s); it is started again in %g s", self.name, why, pause_s)
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, longest_s)

    async def _run(self, service: LiveService) -> int:
        """Start the process and hand over to it until it ends; return its exit code."""
        pipe = asyncio.subprocess.PIPE
        process = await asyncio.create_subprocess_exec(*self._command, stdin=pipe, process_group=0)  # no Ctrl-C for it
        assert process.stdin is not None
        self._shown.clear()
        self._flags = dict.fromkeys(service.sessions, 0) | self._flags
        try:
            if sys.platform != "win32":
                os.setpriority(os.PRIO_PROCESS, process.pid, os.nice(0) + NICENESS)
            while process.returncode is None:
                began_s = time.monotonic()
                await self._hand_over(service, process.stdin)
                await asyncio.sleep(max(0.01, 1.0 / self._settings.update_hz - (time.monotonic() - began_s)))
            return process.returncode
        finally:
            with suppress(ProcessLookupError):  # it has ended
                process.kill()
            await process.wait()
            process.stdin.close()

    async def _hand_over(self, service: LiveService, pipe: asyncio.StreamWriter) -> None:
        """Write what is new, unless the last is not read yet: then it is merged with what comes."""
        for name in self._flags.keys() - service.sessions:
            del self._flags[name]
        if pipe.transport.get_write_buffer_size():
            self.counts["merged"] += len(self._flags)
            return
        for line in self._lines(service):
            pipe.write(line)
            await asyncio.sleep(0)

    def _lines(self, service: LiveService) -> Iterator[bytes]:
        now_s, sessions = time.monotonic(), service.sessions
        flags, self._flags = self._flags, {}
        shown = [name for name in flags if self._has_object(name)]
        for begin in range(0, len(shown), AT_ONCE):
            some = [sessions[name] for name in shown[begin:][:AT_ONCE] if name in sessions]
            rows = [(each, each.latest) for each in some]
            values = [_values(each, last, flags[each.name], now_s) for each, last in rows if last is not None]
            yield _line("show", values)
        if closed := [name for name, since_s in self._shown.items() if since_s > now_s and name not in sessions]:
            self._shown |= dict.fromkeys(closed, now_s)
            yield _line("close", closed)
        if removed := [name for name, since_s in self._shown.items() if now_s - since_s > KEPT_S]:
            for name in removed:
                del self._shown[name]
            yield _line("remove", removed)

    def _has_object(self, name: str) -> bool:
        """Return whether a session is shown, or can be from now on."""
        if name not in self._shown and len(self._shown) >= self._settings.sessions:
            self.counts["not shown"] += 1
            return False
        self._shown[name] = math.inf
        return True


def _values(session: LiveSession, last: LastRow, flags: int, now_s: float) -> OpcUaValues:
    age_s = now_s - session.last_seen_s
    return OpcUaValues(session.name, last.index, last.time_s, last.newtons, last.flags, flags | last.flags, age_s)


def _line(what: str, of: Sequence[OpcUaValues | str]) -> bytes:
    return json.dumps([what, of]).encode() + b"\n"
