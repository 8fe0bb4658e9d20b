"""One worker process: the application behind uvicorn, on a socket that its supervisor listens on.

``python -m cylinder_friction.service.scoring.worker LISTENING_FD SUPERVISOR_FD FOLDER``; the folder holds
``SETTINGS_FILE`` and ``CURRENT_FILE``. It sends the supervisor a byte per second, the first one once it can
be asked, and ends when the supervisor is gone.
"""

import asyncio
import logging
import math
import os
import resource
import shutil
import socket
import sys
import time
from pathlib import Path

import uvicorn

from cylinder_friction.service.access import AccessError
from cylinder_friction.service.processes import LOG_FORMAT, SETTINGS_FILE
from cylinder_friction.service.scoring.app import create_app
from cylinder_friction.service.scoring.locating import CURRENT_FILE
from cylinder_friction.service.scoring.settings import ServeSettings

_TICKS_PER_S = 10
_KEPT_CONNECTION_S = 65
_ON_ITS_WAY_S = 0.2
_STALLED = 3.0
"""After how many times the longest duration of a request a connection is closed on which nothing went on."""


class Worker(uvicorn.Server):
    """A uvicorn server that has a supervisor, and closes connections that never finish a request."""

    def __init__(self, config: uvicorn.Config, supervisor: socket.socket, longest_s: float) -> None:
        super().__init__(config)
        self._supervisor = supervisor
        self._supervisor.setblocking(False)
        self._stalled_s = _STALLED * longest_s
        self._since: dict[object, tuple[object, float]] = {}

    async def on_tick(self, counter: int) -> bool:
        """Once per second: a sign of life, and a look at the connections; at each tick, whether to end."""
        try:
            if counter % _TICKS_PER_S == 0:
                self._supervisor.send(b".")
                self._close_stalled()
            if self._supervisor.recv(1) == b"":
                self.should_exit = True
        except BlockingIOError:
            pass
        except OSError:
            self.should_exit = True
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more connections; requests that were on their way are served before those that idle are closed."""
        for server in self.servers:
            server.close()
        await asyncio.sleep(_ON_ITS_WAY_S)
        await super().shutdown(sockets)

    def _close_stalled(self) -> None:
        """Close connections whose client sends its request, or reads its response, too slowly."""
        now, before = time.monotonic(), self._since
        self._since = {}
        for connection in list(self.server_state.connections):
            cycle = connection.cycle  # type: ignore[union-attr]  # of HTTP, as no WebSockets are served
            done = cycle is not None and cycle.response_complete
            state = (cycle, done, connection.transport.get_write_buffer_size())
            known = before.get(connection)
            self._since[connection] = known if known is not None and known[0] == state else (state, now)
            if now - self._since[connection][1] > self._stalled_s:
                connection.transport.abort()


def main(listening: int, supervisor: int, folder: Path) -> int:
    """Serve until SIGTERM; return 1 with a message where that cannot begin."""
    logging.basicConfig(format=LOG_FORMAT, level=logging.WARNING)
    try:
        settings = ServeSettings.from_json((folder / SETTINGS_FILE).read_text("utf-8"))
        _limit_memory(settings.max_memory_bytes)
        os.environ["ARROW_DEFAULT_MEMORY_POOL"] = "system"  # another keeps what the largest body has ever taken
        config = uvicorn.Config(
            create_app(settings, folder / CURRENT_FILE),
            ws="none",
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            timeout_keep_alive=_KEPT_CONNECTION_S,
            timeout_graceful_shutdown=math.ceil(settings.timeout_s),
            ssl_certfile=settings.tls_certificate,
            ssl_keyfile=settings.tls_key,
        )
        config.load()
    except (AccessError, OSError) as error:  # ssl.SSLError is one
        sys.stderr.write(f"cylinder-friction serve: {error}\n")
        return 1
    server = Worker(config, socket.socket(fileno=supervisor), settings.timeout_s)
    server.run([socket.socket(fileno=listening)])
    shutil.rmtree(
        folder, ignore_errors=True
    )  # the supervisor is gone: SIGTERM, its way to end a worker, ends here before
    return 0


def _limit_memory(max_bytes: int) -> None:
    """Let an allocation beyond the limit fail, rather than the machine run out of memory."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    allowed = max_bytes if hard == resource.RLIM_INFINITY else min(max_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (allowed, hard))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])))
