"""500 sessions over 20 connections beside damaged sessions and floods of names: no other bit, no connection lost."""

import asyncio
import json
import signal
import sqlite3
import urllib.request
from contextlib import closing
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path

import pytest
from paho.mqtt.client import Client as PahoClient
from websockets.asyncio.client import ClientConnection, connect

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction_live.frames import Acknowledgement, EstimateBlock, SampleBlock, pack_samples, unpack
from live_process import PATIENT, Mosquitto, by_hand, needs_broker
from live_service import running
from test_connection import opening

ROWS, CONNECTIONS, EACH = 20, 20, 25
DAMAGES = (
    "content = '{'",
    "state = substr(state, 2)",
    "state = zeroblob(length(state))",
    "content = '[]'",
    "content = ''",
)


class Line:
    """One connection with its sessions."""

    def __init__(self, place: int, socket: ClientConnection) -> None:
        self.names = [f"press {place}-{number}" for number in range(EACH)]
        self.socket = socket
        self.begun_anew: dict[str, str] = {}

    async def opened(self) -> dict[int, str]:
        """Open all sessions; return the names by handle."""
        by_handle = {}
        for name in self.names:
            await self.socket.send(opening(name))
            reply = json.loads(await self.socket.recv())["opened"]
            by_handle[reply["handle"]] = name
            if reply["begins_anew"]:
                self.begun_anew[name] = reply["begins_anew"]
        return by_handle

    async def stepped(self, samples: Array, first: int, count: int) -> dict[str, bytes]:
        """Send rows of every session; return the newtons of each once all are acknowledged."""
        by_handle, newtons, kept = await self.opened(), dict.fromkeys(self.names, b""), dict.fromkeys(self.names, 0)
        for index in range(first, first + count, ROWS):
            part = samples[index : index + ROWS]
            blocks = [SampleBlock(handle, index, 10.0 + 0.005 * index, part) for handle in by_handle]
            await self.socket.send(b"".join(map(pack_samples, blocks)))
        while min(kept.values()) < first + count:
            message = await self.socket.recv()
            assert isinstance(message, bytes), message
            for block in unpack(message):
                if isinstance(block, Acknowledgement):
                    kept[by_handle[block.handle]] = block.index
                elif isinstance(block, EstimateBlock):
                    newtons[by_handle[block.handle]] += block.newton_bytes
        return newtons


async def all_stepped(
    port: int, samples: Array, first: int, count: int, token: str = ""
) -> tuple[dict[str, bytes], dict[str, str]]:
    """Step the sessions of all connections; return their newtons, and why some began anew."""
    url, headers = f"ws://127.0.0.1:{port}/stream", {"Authorization": f"Bearer {token}"}
    sockets = [await connect(url, max_size=None, additional_headers=headers) for _ in range(CONNECTIONS)]
    lines = [Line(place, socket) for place, socket in enumerate(sockets)]
    parts = await asyncio.gather(*(line.stepped(samples, first, count) for line in lines))
    for socket in sockets:
        await socket.close()
    newtons = {name: part for of_line in parts for name, part in of_line.items()}
    return newtons, {name: why for line in lines for name, why in line.begun_anew.items()}


async def opened_and_left(port: int, names: list[str], token: str) -> list[str]:
    """Open sessions over connections that then leave; return the replies."""
    replies, url = [], f"ws://127.0.0.1:{port}/stream"
    for begin in range(0, len(names), 200):
        async with connect(url, additional_headers={"Authorization": f"Bearer {token}"}) as socket:
            for name in names[begin : begin + 200]:
                await socket.send(opening(name))
                replies.append(str(await socket.recv()))
    return replies


@needs_broker
@pytest.mark.extended
def test_floods_of_names_cost_no_other_anything(
    newtons: Array, samples: Array, model: Path, tmp_path: Path, broker: Mosquitto
) -> None:
    """3,000 names over one MQTT peer, and a client that opens 1,500 sessions and leaves."""
    port, tokens = free_port(), tmp_path / "tokens"
    users = ("plant", "flood", "newcomer")
    tokens.write_text("".join(f"{sha256(user.encode()).hexdigest()} write\n" for user in users), "ascii")
    settings = {
        "limits": asdict(PATIENT) | {"sessions": 1200},  # 500, as many by MQTT, and 200 that come and leave
        "access": {"tokens": str(tokens)},
        "mqtt": {"broker": {"port": broker.port}},
    }

    async def all_at_once(client: PahoClient) -> tuple[dict[str, bytes], list[str]]:
        for place in range(3000):
            client.publish(f"cylinder-friction/name{place}/in", opening(f"name {place}"), qos=1)
        left = [f"left {place}" for place in range(1500)]
        (parts, _), replies = await asyncio.gather(
            all_stepped(port, samples, 0, 400, "plant"), opened_and_left(port, left, "flood")
        )
        return parts, [*replies, *await opened_and_left(port, ["new 1", "new 2"], "newcomer")]

    with running(model, tmp_path / "live", port, settings), by_hand(broker, "cylinder-friction/state") as (client, got):
        assert b"true" in got.get(timeout=60.0)[1]
        parts, replies = asyncio.run(all_at_once(client))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz") as reply:
            assert json.loads(reply.read())["ready"]
    assert len(parts) == CONNECTIONS * EACH
    assert set(parts.values()) == {newtons[:400].tobytes()}
    assert all("opened" in reply for reply in replies)


@pytest.mark.extended
def test_ten_damaged_sessions_cost_no_other_anything(
    small_hybrid: HybridEstimator, newtons: Array, samples: Array, model: Path, tmp_path: Path
) -> None:
    port, settings = free_port(), {"limits": asdict(PATIENT)}
    with running(model, tmp_path, port, settings) as service:
        before, _ = asyncio.run(all_stepped(port, samples, 0, 200))
        service.send_signal(signal.SIGTERM)
        service.wait()
    damaged = [f"press {place}-{place}" for place in range(10)]
    with closing(sqlite3.connect(tmp_path / "journal.db")) as database, database:
        for place, name in enumerate(damaged):
            database.execute(f"UPDATE session SET {DAMAGES[place % len(DAMAGES)]} WHERE name = ?", (name,))
    with running(model, tmp_path, port, settings):
        after, begun_anew = asyncio.run(all_stepped(port, samples, 200, 200))
    assert len(before) == len(after) == CONNECTIONS * EACH
    assert set(before.values()) == {newtons[:200].tobytes()}
    assert set(begun_anew) == set(damaged)
    assert all("what the journal holds of it is damaged" in why for why in begun_anew.values())
    anew = small_hybrid.real_time().run(samples[200:400])[0].tobytes()
    for name, part in after.items():
        assert part == (anew if name in damaged else newtons[200:400].tobytes()), name
