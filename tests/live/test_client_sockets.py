"""A break at any moment is one that the client goes on after."""

from __future__ import annotations

import socket
import threading

import pytest

from cylinder_friction.live.client_sockets import connected


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
