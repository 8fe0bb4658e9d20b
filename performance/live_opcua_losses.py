"""How many samples arrive by OPC UA: single values by publishing interval and queue, and arrays, on loopback.

    python performance/live_opcua_losses.py [--model models/hybrid] [--seconds 5]

asyncua's server, a process of its own, writes three inputs value by value at 100 and 200 Hz, and the same samples as
arrays of 50 ms; the live service's link follows. That server offers every value that is written, so what is lost is
lost to the queue; a server that samples its nodes itself loses in addition what lies between two looks. Prints the
share of what was written that arrived.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

from asyncua import Server, ua

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.live.connection import Peers
from cylinder_friction.live.engine import Engine
from cylinder_friction.live.engine_building import built_engine
from cylinder_friction.live.journal import Journal
from cylinder_friction.live.opcua_client import OpcUaClientLink
from cylinder_friction.live.opcua_settings import OpcUaClientSettings, OpcUaSource
from cylinder_friction.live.service import LiveService
from cylinder_friction.network.ports import free_port

ARRAY_S = 0.05


def main() -> None:
    """Print the table."""
    if sys.argv[1:2] == ["--plant"]:
        asyncio.run(plant(int(sys.argv[2]), float(sys.argv[3]), sys.argv[4:]))
        return
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--model", type=Path, default=Path("models/hybrid"))
    options.add_argument("--seconds", type=float, default=5.0, help="of each row")
    given = options.parse_args()
    estimator = load_estimator(given.model)
    with tempfile.TemporaryDirectory() as folder:
        engine = Engine(built_engine(estimator, Path(folder)))
        print(f"{'written':>26s}{'publishing [ms]':>18s}{'queue':>8s}{'arrived':>12s}")
        for rate_hz in (100.0, 200.0):
            for publishing_ms, queue in ((50.0, 1000), (50.0, 10), (50.0, 1), (500.0, 1000), (500.0, 10), (500.0, 1)):
                share = asyncio.run(arrived(engine, Path(folder), rate_hz, publishing_ms, queue, given.seconds))
                written = f"values at {rate_hz:.0f} Hz"
                print(f"{written:>26s}{publishing_ms:18.0f}{queue:8d}{100 * share:10.1f} %", flush=True)
        for publishing_ms, queue in ((50.0, 1000), (500.0, 1000), (500.0, 1)):
            share = asyncio.run(arrived(engine, Path(folder), 0.0, publishing_ms, queue, given.seconds))
            print(f"{'arrays of 50 ms':>26s}{publishing_ms:18.0f}{queue:8d}{100 * share:10.1f} %", flush=True)


async def arrived(
    engine: Engine, folder: Path, rate_hz: float, publishing_ms: float, queue: int, seconds: float
) -> float:
    """Return the share of what was written that arrived."""
    port, name = free_port(), f"{time.time_ns()}"
    inputs = {each: f"ns=2;s={each}" for each in engine.inputs}
    source = OpcUaSource(name, inputs=inputs) if rate_hz else OpcUaSource(name, samples="ns=2;s=samples")
    settings = OpcUaClientSettings(f"opc.tcp://127.0.0.1:{port}/", (source,), publishing_ms, queue)
    service, link = LiveService(engine, Journal(folder / f"{name}.db")), OpcUaClientLink(settings)
    process = await asyncio.create_subprocess_exec(
        sys.executable, __file__, "--plant", str(port), str(rate_hz), *engine.inputs,
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    await process.stdout.readline()  # it is there
    async with link.running(service, Peers()):
        while not link.counts["connected"]:
            await asyncio.sleep(0.02)
        process.stdin.write(f"{seconds}\n".encode())
        written = int(await process.stdout.readline())
        await asyncio.sleep(2.0)
        session = service.sessions.get(name)
        stepped = 0 if session is None else session.order.counts.stepped
    process.kill()
    await process.wait()
    service.journal.close()
    return link.counts["values"] / written if rate_hz else stepped / written


async def plant(port: int, rate_hz: float, inputs: list[str]) -> None:
    """Serve, and write for as many seconds as a line on standard input states; print how much was written."""
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    await server.register_namespace("urn:plant")
    for name in ("samples", *inputs):
        identifier = ua.NodeId(name, 2)
        null = ua.VariantType.Null
        await server.nodes.objects.add_variable(identifier, ua.QualifiedName(name, 2), None, null, ua.NodeId(11))
    async with server:
        print("there", flush=True)
        seconds = float(await asyncio.to_thread(sys.stdin.readline))
        every_s = 1.0 / rate_hz if rate_hz else ARRAY_S
        rows = round(ARRAY_S / 0.005)
        begin_s = time.time()
        steps = int(seconds / every_s)
        for step in range(steps):
            moment = datetime.fromtimestamp(begin_s + step * every_s, UTC)
            for name in inputs if rate_hz else ["samples"]:
                value = [float(step * rows), *[1e5 + step] * (rows * len(inputs))] if not rate_hz else 1e5 + step
                written = ua.DataValue(ua.Variant(value, ua.VariantType.Double), ua.StatusCode(), moment)
                await server.write_attribute_value(ua.NodeId(name, 2), written)
            await asyncio.sleep(max(0.0, begin_s + (step + 1) * every_s - time.time()))
        print(steps * len(inputs) if rate_hz else steps * rows, flush=True)
        await asyncio.sleep(60.0)


if __name__ == "__main__":
    main()
