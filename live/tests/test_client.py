"""A client that misses estimates asks for them again, goes on after any break, and knows its addresses."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction_live import client as client_module
from cylinder_friction_live.client import Client
from cylinder_friction_live.client_sockets import LiveClientError, connected
from cylinder_friction_live.frames import Acknowledgement, EstimateBlock, pack_acknowledgement, pack_estimates, unpack
from cylinder_friction_live.service import LiveService
from live_process import served


class Leaky:
    """A socket that keeps the first estimates from index 100 on to itself, as a broker may."""

    window = None
    lost: int = 0

    def __init__(self, inner: Any) -> None:
        self.send, self._inner = inner.send, inner

    def recv(self, timeout_s: float) -> bytes | str:
        message = self._inner.recv(timeout_s)
        if isinstance(message, bytes) and not Leaky.lost:
            Leaky.lost = sum(len(e.flags) for e in unpack(message) if isinstance(e, EstimateBlock) and e.index >= 100)
            if Leaky.lost:
                raise TimeoutError  # nothing arrives
        return bytes(message) if isinstance(message, bytes) else str(message)


def test_estimates_that_were_lost_on_their_way_are_asked_for_again(
    service: LiveService, newtons: Array, samples: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def leaky(*given: Any) -> Iterator[Leaky]:
        with connected(*given) as inner:
            yield Leaky(inner)

    monkeypatch.setattr(client_module, "connected", leaky)
    port = free_port()

    def use() -> Array:
        parts = []
        with Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as client:
            for begin in range(0, 500, 50):
                client.send(samples[begin : begin + 50])
                parts.append(client.estimates(60.0))
            while sum(len(flags) for _, _, flags in parts) < 500:
                parts.append(client.estimates(60.0))
                assert len(parts[-1][2]) > 0
        assert [index for index, _, _ in parts] == np.cumsum([0, *(len(each) for _, each, _ in parts[:-1])]).tolist()
        return np.concatenate([newtons for _, newtons, _ in parts])

    got = served([], service, use, port)
    assert Leaky.lost > 0
    np.testing.assert_array_equal(got, newtons[:500])


def test_after_samples_that_were_left_out_a_client_stays_connected(
    service: LiveService, samples: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is missing where nothing was sent; connecting again would send all that is not acknowledged again."""
    connections: list[str] = []

    @contextmanager
    def counted(url: str, *given: Any) -> Iterator[Any]:
        connections.append(url)
        with connected(url, *given) as inner:
            yield inner

    monkeypatch.setattr(client_module, "connected", counted)
    port = free_port()

    def use() -> list[int]:
        begun = []
        with Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as client:
            for _ in range(3):
                client.send(samples[:50])
                client.skip(12_000)
                begun.append(client.estimates(60.0)[0])
            client.wait_until_kept()
        return begun

    assert served([], service, use, port) == [0, 12_050, 24_100]
    assert len(connections) == 1


@contextmanager
def service_that_sends(*connections: list[bytes | str]) -> Iterator[str]:
    """The address of a service that gives each connection in turn these messages, after its first one."""
    left = list(connections)

    def serve_one(socket: ServerConnection) -> None:
        socket.recv()
        for message in left.pop(0):
            socket.send(message)
        with suppress(ConnectionClosed):
            while True:
                socket.recv()

    with serve(serve_one, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}/stream"
        server.shutdown()


def opened(index: int = 0) -> str:
    return json.dumps({"opened": {"handle": 1, "next_index": index, "kept_index": index}})


def test_a_client_names_how_many_samples_were_not_acknowledged_when_acknowledgements_no_longer_come() -> None:
    kept = [pack_acknowledgement(Acknowledgement(1, rows)) for rows in (10, 20, 30, 40)]
    with service_that_sends([opened(), *kept]) as url, Client(url, "press 7", 0.005) as client:
        client.send(np.zeros((100, 3)))
        with pytest.raises(LiveClientError, match=r"'press 7': 60 samples are not acknowledged, .* for 1 s; /readyz"):
            client.wait_until_kept(timeout_s=1.0)


def test_a_service_that_is_away_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client_module, "PATIENCE_S", 0.3)
    url = f"ws://127.0.0.1:{free_port()}/stream"
    with pytest.raises(LiveClientError, match=rf"^{url}: not reached in 0.3 s \(.*refused"):
        Client(url, "press", 0.005)


def test_a_client_that_is_to_come_back_later_does() -> None:
    later = json.dumps({"error": "too many", "retry_after_s": 0.1})
    with service_that_sends([later], [opened(7)]) as url, Client(url, "press", 0.005) as client:
        assert client.next_index == 7


def test_estimates_are_returned_at_once_also_behind_other_messages() -> None:
    estimates = pack_estimates(EstimateBlock.of(1, 0, 0.0, np.ones((20, 3)), np.zeros(20, np.uint32)))
    behind = [pack_acknowledgement(Acknowledgement(1, 0))] * 3
    with service_that_sends([opened(), *behind, estimates]) as url, Client(url, "press", 0.005) as client:
        assert len(client.estimates(timeout_s=60.0)[1]) == 20
        assert len(client.estimates(timeout_s=0.0)[1]) == 0


LEFT_OPEN = """
import sys
from cylinder_friction_live.client import Client
client = Client(sys.argv[1], "press", 0.005)
client.itself = client
"""
"""The collector finds the cycle at exit only, after the socket."""


def test_a_client_that_nobody_closes_leaves_nothing_at_exit(service: LiveService) -> None:
    port = free_port()

    def use() -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", LEFT_OPEN, f"ws://127.0.0.1:{port}/stream"]
        return subprocess.run(command, capture_output=True, text=True, check=True)

    assert served([], service, use, port).stderr == ""


def test_an_address_of_no_known_kind_is_named() -> None:
    with pytest.raises(ValueError, match=r"'http://127.0.0.1': expected ws://HOST:PORT/stream, wss://..., mqtt://"):
        connected("http://127.0.0.1")


@pytest.mark.parametrize("begun", [b"", b"HTTP/1.1 101 Switch"])
def test_a_service_that_ends_while_it_greets_is_a_break(begun: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def greet() -> None:
            client, _ = server.accept()
            client.recv(1000)
            client.sendall(begun)
            client.close()

        greeting = threading.Thread(target=greet)
        greeting.start()
        with pytest.raises(OSError), connected(f"ws://127.0.0.1:{server.getsockname()[1]}/stream"):  # noqa: PT011
            pass
        greeting.join()


def test_neither_side_waits_for_the_other_when_much_is_sent_before_anything_is_read() -> None:
    """More than all buffers between them hold, both ways: who sends has to read meanwhile."""
    part, count = os.urandom(200_000), 100  # random: compressed it would be too little

    def both_ways(connection: ServerConnection) -> None:
        for _ in range(count):
            connection.send(part)
        for _ in range(count):
            assert connection.recv() == part
        connection.send("all came")

    got: list[bytes | str] = []

    def client(port: int) -> None:
        with connected(f"ws://127.0.0.1:{port}/stream") as service:
            for _ in range(count):
                service.send(part)
            got.extend(service.recv(60.0) for _ in range(count + 1))

    with serve(both_ways, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        sending = threading.Thread(target=client, args=(server.socket.getsockname()[1],), daemon=True)
        sending.start()
        sending.join(60.0)
        assert not sending.is_alive(), "both wait"
        server.shutdown()
    assert got == [part] * count + ["all came"]
