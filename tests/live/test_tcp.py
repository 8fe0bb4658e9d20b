"""Raw TCP gives the same bits as the step; what is no message is named, and then the connection ends."""

from __future__ import annotations

import asyncio
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.live.app import create_app
from cylinder_friction.live.client import Client
from cylinder_friction.live.connection import Peers
from cylinder_friction.live.journal import Journal
from cylinder_friction.live.service import LiveService
from cylinder_friction.live.settings import LiveLimits, LiveSettingsError, TcpSettings
from cylinder_friction.live.tcp import HEAD, TcpLink, packed

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.live.engine import Engine


def test_the_client_gets_the_newtons_of_the_step(
    engine: Engine, small_hybrid: HybridEstimator, samples: Array, tmp_path: Path
) -> None:
    newtons, flags = small_hybrid.real_time().run(samples)

    def use(address: str) -> tuple[Array, Array]:
        with Client(address, "press", 0.005) as client:
            client.send(samples[:700])
        with Client(address, "press", 0.005) as client:
            assert client.next_index == 700
            client.send(samples[700:])
            client.wait_until_kept()
            parts = []
            while len((part := client.estimates(0.2))[2]):
                parts.append(part)
        return np.concatenate([each[1] for each in parts]), np.concatenate([each[2] for each in parts])

    async def run() -> tuple[Array, Array]:
        link = TcpLink(TcpSettings(port=0))
        app = create_app(LiveService(engine, Journal(tmp_path / "journal.db")), tmp_path / "history", [link])
        async with app.router.lifespan_context(app):
            return await asyncio.to_thread(use, link.address)

    got = asyncio.run(run())
    np.testing.assert_array_equal(got[0], newtons[700:])
    np.testing.assert_array_equal(got[1], flags[700:])


@pytest.mark.parametrize(
    ("sent", "words"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", "got a message of kind 47"),
        (HEAD.pack(1001, 1), "kind 1 and 1001 bytes; expected 1 (frames) or 2 (JSON), and at most 1000"),
        (HEAD.pack(0, 1), "of kind 1 and 0 bytes"),
        (HEAD.pack(2, 2) + b"\xff\xfe", "got text that is no UTF-8"),
    ],
)
def test_after_garbage_the_connection_ends_with_its_reason(
    engine: Engine, tmp_path: Path, sent: bytes, words: str
) -> None:
    async def run() -> tuple[bytes, Peers]:
        link, peers = TcpLink(TcpSettings(port=0)), Peers()
        service = LiveService(engine, Journal(tmp_path / "journal.db"), limits=LiveLimits(message_bytes=1000))
        async with link.running(service, peers):
            reader, writer = await asyncio.open_connection("127.0.0.1", int(link.address.rpartition(":")[2]))
            writer.write(sent)
            reply = await reader.read()
            writer.close()
            assert peers.connections == 0
            return reply, peers

    reply, peers = asyncio.run(run())
    assert HEAD.unpack_from(reply) == (len(reply) - HEAD.size, 2)
    assert words in json.loads(reply[HEAD.size :])["error"]
    assert peers.refused == {"FrameError": 1}


def test_a_client_that_breaks_off_within_a_message_leaves_nothing(engine: Engine, tmp_path: Path) -> None:
    async def run() -> tuple[int, int]:
        link, peers = TcpLink(TcpSettings(port=0)), Peers()
        async with link.running(LiveService(engine, Journal(tmp_path / "journal.db")), peers):
            reader, writer = await asyncio.open_connection("127.0.0.1", int(link.address.rpartition(":")[2]))
            writer.write(packed("{"))
            await reader.readexactly(HEAD.size)
            during = peers.connections
            writer.write(HEAD.pack(100, 1) + b"half")
            writer.write_eof()
            await reader.read()
            writer.close()
            return during, peers.connections

    assert asyncio.run(run()) == (1, 0)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"host": "0.0.0.0"}, "tcp.host: got '0.0.0.0', expected one of 127.0.0.1"),
        ({"port": 70000}, "tcp.port: got 70000"),
    ],
)
def test_it_stays_on_this_machine(settings: dict[str, object], words: str) -> None:
    with pytest.raises(LiveSettingsError, match=words):
        TcpSettings(**settings)  # type: ignore[arg-type]
