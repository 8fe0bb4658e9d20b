"""A live service as a process of its own, its broker and its clients, for tests of what is outside it."""

import getpass
import json
import os
import queue
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

import numpy as np
import pytest
from paho.mqtt.client import Client as PahoClient
from paho.mqtt.client import MQTTv5
from paho.mqtt.enums import CallbackAPIVersion
from starlette.applications import Starlette
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction_live.access import Access
from cylinder_friction_live.app import create_app
from cylinder_friction_live.frames import SampleBlock, pack_samples
from cylinder_friction_live.links.link import Link
from cylinder_friction_live.server import live_server
from cylinder_friction_live.service import LiveService
from cylinder_friction_live.settings import LiveLimits


@contextmanager
def stalled_client(url: str, samples: Array, headers: dict[str, str] | None = None) -> Iterator[socket.socket]:
    """The socket of a client that has sent until the service read no more from it, because it reads nothing."""
    own, sent = socket.socket(), [0]
    own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    own.connect((urlsplit(url).hostname, urlsplit(url).port))
    inputs = ["pressure_1_pa", "pressure_2_pa", "position_m"]

    def send(client: ClientConnection, handle: int) -> None:
        with suppress(ConnectionClosed, OSError):
            for index in count(0, 1000):
                part = samples[np.arange(index, index + 1000) % len(samples)]
                client.send(pack_samples(SampleBlock(handle, index, 0.005 * index, part)))
                sent[0] = index

    with connect(url, sock=own, max_queue=1, close_timeout=0.1, additional_headers=headers) as client:
        client.send(json.dumps({"open": {"session": "stalled", "inputs": inputs, "sample_time_s": 0.005}}))
        threading.Thread(target=send, args=(client, json.loads(client.recv())["opened"]["handle"]), daemon=True).start()
        before = -1
        while sent[0] != before:
            before = sent[0]
            time.sleep(1.0)
        try:
            yield own
        finally:
            with suppress(OSError):
                own.shutdown(socket.SHUT_RDWR)


PATIENT = LiveLimits(loop_lag_s=60.0)
"""Of a service that refuses no new session because the machine is busy: what opens one here does so once."""
MOSQUITTO = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
"""Debian keeps it off the path of users."""
needs_broker = pytest.mark.skipif(MOSQUITTO is None, reason="mosquitto is not installed")


def keep(service: LiveService) -> None:
    """Write and acknowledge everything now, as ``keep_each_second`` does."""
    saved, chunks = service.take_pending(service.sessions.values())
    service.journal.keep(saved, chunks)
    service.kept(saved)


class Mosquitto:
    """A broker on loopback that can be stopped and started again at the same port; further settings are its own."""

    def __init__(self, folder: Path, *settings: str) -> None:
        self.port = free_port()
        self._file = folder / "mosquitto.conf"
        self.configure(*(settings or ("allow_anonymous true",)))
        self._process: subprocess.Popen[bytes] | None = None

    def configure(self, *settings: str) -> None:
        """Write its settings, for the next start."""
        lines = [f"user {getpass.getuser()}", f"listener {self.port} 127.0.0.1", *settings]
        self._file.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def start(self) -> None:
        """Start it; returns when it listens."""
        self._process = subprocess.Popen([str(MOSQUITTO), "-c", str(self._file)], stderr=subprocess.DEVNULL)
        for _ in range(200):
            try:
                socket.create_connection(("127.0.0.1", self.port), 1.0).close()
                break
            except OSError:
                time.sleep(0.05)

    @property
    def pid(self) -> int:
        """Number of its process."""
        assert self._process is not None
        return self._process.pid

    def kill(self) -> None:
        """End it at once, with all that it held."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()


@contextmanager
def serving(app: Starlette, port: int = 0, access: Access | None = None) -> Iterator[str]:
    """The address, as ``HOST:PORT``, of an application that runs in a thread."""
    server = live_server(app, "127.0.0.1", port, access or Access(), LiveLimits().message_bytes)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    try:
        while not server.started:
            assert thread.is_alive(), "the service ended while it started"
            time.sleep(0.01)
        yield f"127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(60.0)


def served(links: Sequence[Link], service: LiveService, use: Callable[[], Any], port: int = 0) -> Any:
    """What ``use`` returns while the service runs, its WebSocket at ``port``."""
    with serving(create_app(service, links), port):
        return use()


@contextmanager
def by_hand(broker: Mosquitto, *topics: str) -> Iterator[tuple[PahoClient, queue.Queue[tuple[str, bytes]]]]:
    """A client that is not ours, and what it gets."""
    client, ready = PahoClient(CallbackAPIVersion.VERSION2, protocol=MQTTv5), threading.Event()
    got: queue.Queue[tuple[str, bytes]] = queue.Queue()
    client.on_message = lambda _client, _data, message: got.put((message.topic, bytes(message.payload)))
    client.on_subscribe = lambda *_: ready.set()
    client.connect("127.0.0.1", broker.port)
    client.subscribe([(topic, 1) for topic in topics])
    client.loop_start()
    try:
        assert ready.wait(60.0)
        yield client, got
    finally:
        client.disconnect()
        client.loop_stop()


class Relay:
    """A way to a port of this machine that can be cut; who comes again gets through again."""

    def __init__(self, port: int) -> None:
        self._to, self._listening, self._pairs = port, socket.create_server(("127.0.0.1", 0)), list[socket.socket]()
        self.port = int(self._listening.getsockname()[1])
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """End all connections at once."""
        for each in self._pairs:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self.cut()

    def _accept(self) -> None:
        with self._listening, suppress(OSError):
            while True:
                pair = [self._listening.accept()[0], socket.create_connection(("127.0.0.1", self._to))]
                self._pairs += pair
                for one, other in (pair, pair[::-1]):
                    threading.Thread(target=self._carry, args=(one, other), daemon=True).start()

    @staticmethod
    def _carry(one: socket.socket, other: socket.socket) -> None:
        with one, suppress(OSError):
            while part := one.recv(1 << 16):
                other.sendall(part)
            other.shutdown(socket.SHUT_RDWR)
