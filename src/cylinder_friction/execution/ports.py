"""Ports of this machine."""

import socket


def free_port(wanted: int = 0) -> int:
    """Find a free port of this machine: any, or ``wanted``.

    Raises:
        OSError: Something listens on the wanted one.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a port that was just closed is free
        probe.bind(("127.0.0.1", wanted))
        return int(probe.getsockname()[1])
