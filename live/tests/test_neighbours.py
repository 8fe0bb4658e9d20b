"""500 sessions over 20 connections beside damaged sessions and floods of names: no other bit, no connection lost."""

import asyncio
import json
import signal
import sqlite3
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import pytest
from websockets.asyncio.client import ClientConnection, connect

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction_live.frames import Acknowledgement, EstimateBlock, SampleBlock, pack_samples, unpack
from live_process import PATIENT
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


async def all_stepped(port: int, samples: Array, first: int, count: int) -> tuple[dict[str, bytes], dict[str, str]]:
    """Step the sessions of all connections; return their newtons, and why some began anew."""
    sockets = [await connect(f"ws://127.0.0.1:{port}/stream", max_size=None) for _ in range(CONNECTIONS)]
    lines = [Line(place, socket) for place, socket in enumerate(sockets)]
    parts = await asyncio.gather(*(line.stepped(samples, first, count) for line in lines))
    for socket in sockets:
        await socket.close()
    newtons = {name: part for of_line in parts for name, part in of_line.items()}
    return newtons, {name: why for line in lines for name, why in line.begun_anew.items()}


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
