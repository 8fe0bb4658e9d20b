"""The live service under load: share of its core, time from a frame's last sample to its newtons, losses, memory.

The service has one core for itself, the senders have the other. Each connection sends one frame per interval for all of
its sessions, at the rate of the model; every estimate is compared with that of a stream of its own.

    PYTHONPATH=performance python live/performance/live_load.py --sessions 500 --connections 20 --seconds 600
"""

import argparse
import asyncio
import json
import os
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from websockets.asyncio.client import ClientConnection, connect

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction_live.frames import Acknowledgement, EstimateBlock, SampleBlock, pack_samples, unpack
from live_service import arguments, running

PORT = free_port()


@dataclass
class Seen:
    """What one connection saw."""

    latencies_s: list[float] = field(default_factory=list)
    estimates: int = 0
    wrong: int = 0
    acknowledged: dict[int, int] = field(default_factory=dict)


def main() -> None:
    """Run it and print one table."""
    options = arguments(__doc__, sessions=500)
    options.add_argument("--connections", type=int, default=20)
    options.add_argument("--frame-ms", type=float, default=20.0)
    options.add_argument("--seconds", type=float, default=60.0)
    given = options.parse_args()
    estimator = load_estimator(given.model)
    samples = read_stored(given.recordings)[0].samples(estimator.inputs)
    rows = max(1, round(1e-3 * given.frame_ms / float(estimator.sample_time_s or 0.005)))
    samples = samples[: len(samples) // rows * rows]
    frames = int(given.seconds / (1e-3 * given.frame_ms))
    cores = sorted(os.sched_getaffinity(0))
    settings = {"limits": {"sessions_per_user": given.sessions}}
    with (
        tempfile.TemporaryDirectory() as folder,
        running(given.model, Path(folder), PORT, settings, cores[:1]) as service,
    ):
        os.sched_setaffinity(0, cores[1:] or cores)
        asyncio.run(load(given, estimator, samples, rows, frames, psutil.Process(service.pid)))


async def load(
    given: argparse.Namespace, estimator: Any, samples: np.ndarray, rows: int, frames: int, service: psutil.Process
) -> None:
    """Send and receive over all connections, then print."""
    newtons, _ = estimator.real_time().run(np.tile(samples, (-(-frames * rows // len(samples)), 1)))
    per_connection = given.sessions // given.connections
    sockets = [await connect(f"ws://127.0.0.1:{PORT}/stream", max_size=None) for _ in range(given.connections)]
    inputs = tuple(estimator.inputs)
    handles = [await opened(each, place, per_connection, inputs) for place, each in enumerate(sockets)]
    seen = [Seen() for _ in sockets]
    sent_at = [np.zeros(frames) for _ in sockets]
    readers = [asyncio.create_task(read(*each, newtons, rows)) for each in zip(sockets, seen, sent_at, strict=True)]
    await asyncio.sleep(0.5)
    before = sum(service.cpu_times()[:2])
    memory_bytes: list[float] = []
    begin_s = time.monotonic()
    writers = [
        write(socket, own, samples.reshape(-1, rows, len(inputs)), 1e-3 * given.frame_ms, begin_s + 1e-3 * place, at)
        for place, (socket, own, at) in enumerate(zip(sockets, handles, sent_at, strict=True))
    ]
    watching = asyncio.create_task(watch(service, memory_bytes))
    await asyncio.gather(*writers)
    lasted_s, used_s = time.monotonic() - begin_s, sum(service.cpu_times()[:2]) - before
    await asyncio.sleep(3.0)
    for task in [*readers, watching]:
        task.cancel()
    expected = given.connections * per_connection * frames * rows
    estimates = sum(each.estimates for each in seen)
    kept = sum(sum(each.acknowledged.values()) for each in seen)
    latencies_ms = 1e3 * np.concatenate([each.latencies_s for each in seen])
    quantiles = np.quantile(latencies_ms, (0.5, 0.99, 0.999, 1.0))
    quarters = [np.median(each) for each in np.array_split(memory_bytes, 4)]
    print(f"{given.sessions} sessions x {rows / (1e-3 * given.frame_ms):.0f} Hz, {given.connections} connections, "
          f"frames of {given.frame_ms:g} ms, {lasted_s:.0f} s")  # fmt: skip
    per_second = estimates / used_s
    print(f"core                 {100 * used_s / lasted_s:.0f} % of one; {per_second:,.0f} samples a second of it")
    print(f"sent to newtons [ms] median {quantiles[0]:.1f}, 99 % {quantiles[1]:.1f}, 99.9 % {quantiles[2]:.1f}, "
          f"worst {quantiles[3]:.1f}")  # fmt: skip
    wrong = sum(each.wrong for each in seen)
    print(f"estimates            {estimates:,} of {expected:,}; other than a stream's own: {wrong}")
    print(f"acknowledged         {kept:,}")
    print(f"memory [MB]          medians of the quarters {', '.join(f'{1e-6 * each:.1f}' for each in quarters)}; "
          f"most {1e-6 * max(memory_bytes):.1f}")  # fmt: skip


async def opened(socket: ClientConnection, place: int, count: int, inputs: tuple[str, ...]) -> list[int]:
    """Open a connection's sessions; return their handles."""
    handles = []
    for number in range(count):
        name = f"press {place}-{number}"
        await socket.send(json.dumps({"open": {"session": name, "inputs": inputs, "sample_time_s": 0.005}}))
        handles.append(int(json.loads(await socket.recv())["opened"]["handle"]))
    return handles


async def write(
    socket: ClientConnection, handles: list[int], parts: np.ndarray, interval_s: float, begin_s: float, at_s: np.ndarray
) -> None:
    """Send one message per interval, each with a block per session, and note when."""
    for frame in range(len(at_s)):
        part, index = parts[frame % len(parts)], frame * parts.shape[1]
        blocks = [SampleBlock(handle, index, 1e9 + frame * interval_s, part) for handle in handles]
        message = b"".join(map(pack_samples, blocks))
        await asyncio.sleep(max(0.0, begin_s + frame * interval_s - time.monotonic()))
        at_s[frame] = time.monotonic()
        await socket.send(message)


async def read(socket: ClientConnection, seen: Seen, sent_at: np.ndarray, newtons: np.ndarray, rows: int) -> None:
    """Take in what comes back."""
    async for message in socket:
        now_s = time.monotonic()
        if isinstance(message, str):
            raise RuntimeError(message)
        last = -1
        for block in unpack(message):
            if isinstance(block, Acknowledgement):
                seen.acknowledged[block.handle] = block.index
            elif isinstance(block, EstimateBlock):
                count = len(block.flags)
                seen.estimates += count
                if block.newtons.tobytes() != newtons[block.index : block.index + count].tobytes():
                    seen.wrong += count
                if block.index != last:
                    last = block.index
                    seen.latencies_s.append(now_s - sent_at[block.index // rows])


async def watch(service: psutil.Process, memory_bytes: list[float]) -> None:
    """Note the service's memory each second."""
    while True:
        memory_bytes.append(service.memory_info().rss)
        await asyncio.sleep(1.0)


if __name__ == "__main__":
    main()
