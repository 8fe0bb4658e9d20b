"""A break at any moment is one that the client goes on after."""

from __future__ import annotations

import os
import socket
import threading

import pytest
from websockets.sync.server import ServerConnection, serve

from cylinder_friction.service.client_sockets import connected


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
