"""How much others wait while one connection of the live service does not read, or an OPC UA client follows everything.

    python performance/live_disturbed.py [--sessions 100] [--connections 20] [--seconds 10] [--rounds 3]

One service, on a core of its own, under the load of ``live_load.py``; stretches without a disturbance, with a
connection that sends and never reads, and with an OPC UA client that subscribes to all values of all sessions
take turns; the latter twice, with the process of the OPC UA server on the senders' core and on the service's. What is
put on the senders' core runs only when they do not (``SCHED_IDLE``), so that it does not make them late. Prints the
99 % quantile of the time from sending a frame to its newtons in each, and the ratios to the stretches without.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import psutil
from asyncua import Client
from asyncua.common.subscription import Subscription
from live_load import PORT, Seen, opened, read, write
from live_service import running
from websockets.asyncio.client import ClientConnection, connect

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.live.frames import SampleBlock, pack_samples
from cylinder_friction.network.ports import free_port
from cylinder_friction.recordings.storage import read_recordings

OPCUA_PORT, SETTLE_S, PATIENCE_S = free_port(), 2.0, 3.0
OPCUA, SAME_CORE = "an OPC UA client", "the same, its server on the service's core"
DISTURBANCES = ("nothing", "a stalled reader", OPCUA, SAME_CORE)


def main() -> None:
    """Run it and print the table."""
    if sys.argv[1:2] == ["--follow"]:
        asyncio.run(follow(sys.argv[2]))
        return
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--model", type=Path, default=Path("models/hybrid"))
    options.add_argument("--recordings", type=Path, default=Path("data/processed/test"))
    options.add_argument("--sessions", type=int, default=100)
    options.add_argument("--connections", type=int, default=20)
    options.add_argument("--frame-ms", type=float, default=20.0)
    options.add_argument("--seconds", type=float, default=10.0, help="of each stretch")
    options.add_argument("--rounds", type=int, default=3)
    given = options.parse_args()
    estimator = load_estimator(given.model)
    samples = read_recordings(given.recordings)[0].samples(estimator.inputs)
    cores = sorted(os.sched_getaffinity(0))
    settings = {"opcua_server": {"port": OPCUA_PORT, "update_hz": 2.0}}
    with (
        tempfile.TemporaryDirectory() as folder,
        running(given.model, Path(folder), PORT, settings, cores[:1]) as service,
    ):
        os.sched_setaffinity(0, cores[1:] or cores)
        (server,) = psutil.Process(service.pid).children()
        asyncio.run(load(given, samples, estimator, server))


async def load(
    given: argparse.Namespace, samples: np.ndarray, estimator: FrictionEstimator, server: psutil.Process
) -> None:
    """Send and receive all the time, disturb in turns, print."""
    inputs, interval_s = tuple(estimator.inputs), 1e-3 * given.frame_ms
    rows = max(1, round(interval_s / 0.005))
    samples = samples[: len(samples) // rows * rows]
    stretches = [each for _ in range(given.rounds) for each in DISTURBANCES]
    frames = int(len(stretches) * (given.seconds + 3 * SETTLE_S) / interval_s) + 500
    newtons, _ = estimator.real_time().run(np.tile(samples, (-(-frames * rows // len(samples)), 1)))
    per_connection = given.sessions // given.connections
    sockets = [await connect(f"ws://127.0.0.1:{PORT}/stream", max_size=None) for _ in range(given.connections)]
    handles = [await opened(each, place, per_connection, inputs) for place, each in enumerate(sockets)]
    seen, sent_at = [Seen() for _ in sockets], [np.zeros(frames) for _ in sockets]
    readers = [asyncio.create_task(read(*each, newtons, rows)) for each in zip(sockets, seen, sent_at, strict=True)]
    begin_s = time.monotonic() + 0.5
    writers = [
        asyncio.create_task(write(socket, own, samples, rows, frames, interval_s, begin_s + 1e-3 * place, at))
        for place, (socket, own, at) in enumerate(zip(sockets, handles, sent_at, strict=True))
    ]
    await asyncio.sleep(3.0)
    quantiles_ms: dict[str, list[float]] = {each: [] for each in DISTURBANCES}
    for stretch in stretches:
        place(server, beside_service=stretch == SAME_CORE)
        async with disturbed(stretch, inputs, samples):
            await asyncio.sleep(SETTLE_S)
            before = [len(each.latencies_s) for each in seen]
            await asyncio.sleep(given.seconds)
            latencies_s = [each.latencies_s[first:] for each, first in zip(seen, before, strict=True)]
            quantiles_ms[stretch].append(1e3 * float(np.quantile(np.concatenate(latencies_s), 0.99)))
        await asyncio.sleep(SETTLE_S)
    for task in [*readers, *writers]:
        task.cancel()
    print(
        f"{given.sessions} sessions, {given.connections} connections, frames of {given.frame_ms:g} ms, {given.rounds} "
        f"stretches of {given.seconds:g} s each; other than a stream's own: {sum(each.wrong for each in seen)}"
    )
    for name, values in quantiles_ms.items():
        ratio = np.median(np.divide(values, quantiles_ms["nothing"]))
        shown = ", ".join(f"{each:.2f}" for each in values)
        print(f"  beside {name:42s} 99 % [ms] {shown}; median of the ratios {ratio:.2f}")


def place(server: psutil.Process, *, beside_service: bool) -> None:
    """Put the OPC UA server's process on the service's core, as it is, or on the senders', where it comes last."""
    cores = psutil.Process(server.ppid()).cpu_affinity() if beside_service else list(os.sched_getaffinity(0))
    for thread in server.threads():
        os.sched_setaffinity(thread.id, cores)
        os.sched_setscheduler(thread.id, os.SCHED_OTHER if beside_service else os.SCHED_IDLE, os.sched_param(0))


def come_last() -> None:
    """Run only when nobody else wants the core."""
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


@asynccontextmanager
async def disturbed(how: str, inputs: tuple[str, ...], samples: np.ndarray) -> AsyncIterator[None]:
    """Disturb the service in a way while what stands within runs."""
    if how == "a stalled reader":
        async with connect(f"ws://127.0.0.1:{PORT}/stream", max_size=None, close_timeout=0.1) as socket:
            sending = asyncio.create_task(send_only(socket, await opened(socket, 999, 1, inputs), samples))
            yield
            sending.cancel()
            socket.transport.abort()
    elif how in {OPCUA, SAME_CORE}:
        follow = (sys.executable, __file__, "--follow", str(OPCUA_PORT))
        follower = await asyncio.create_subprocess_exec(*follow, preexec_fn=come_last)
        try:
            await asyncio.sleep(SETTLE_S)
            yield
        finally:
            follower.terminate()  # it takes its leave: killed, it would be served until its session times out
            try:
                async with asyncio.timeout(PATIENCE_S):
                    await follower.wait()
            except TimeoutError:
                follower.kill()
                await follower.wait()
    else:
        yield


async def send_only(socket: ClientConnection, handles: list[int], samples: np.ndarray) -> None:
    """Send a session's samples, ten times as fast as they are taken, and read nothing."""
    for index in range(0, 10**9, 20):
        part = samples[index % (len(samples) - 20) :][:20]
        await socket.send(pack_samples(SampleBlock(handles[0], index, 1e9 + 0.005 * index, part)))
        await asyncio.sleep(0.01)


async def follow(port: str) -> None:
    """Subscribe to everything that the service shows, and read it until SIGTERM."""
    stop = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop.set)
    async with Client(f"opc.tcp://127.0.0.1:{port}/") as client:
        folder = await client.nodes.objects.get_child("2:CylinderFriction")
        nodes = [node for session in await folder.get_children() for node in await session.get_children()]
        subscription = await client.create_subscription(500.0)
        await subscription.subscribe_data_change(nodes)
        reading = asyncio.create_task(read_all(subscription))
        await stop.wait()
        reading.cancel()


async def read_all(subscription: Subscription) -> None:
    """Read what comes."""
    async for _ in subscription:
        pass


if __name__ == "__main__":
    main()
