"""WebSocket and MQTT side by side: round trip, share of a core, and what a broker that is killed costs.

Clients, a thread each, send frames in their own time and time each until its newtons are there; every estimate is
compared with that of a stream of its own. Then the broker is killed in the middle, once under the client that sends
again what is not acknowledged, and once under publishers that trust the broker alone, with QoS 1 and with QoS 0.

    python performance/live_links.py --sessions 10 --frame-ms 20 --seconds 12
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from live_service import running
from paho.mqtt.client import Client as PahoClient
from paho.mqtt.client import MQTTv5
from paho.mqtt.enums import CallbackAPIVersion

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.live.client import Client
from cylinder_friction.live.frames import SampleBlock, pack_samples
from cylinder_friction.network.ports import free_port
from cylinder_friction.recordings.storage import read_recordings

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from live_process import Mosquitto

BROKER = ("allow_anonymous true", "set_tcp_nodelay true")
"""Without the second a small message waits up to 40 ms in the broker."""
AWAY_S = 1.0
"""So long the broker is away."""


@dataclass
class Load:
    """What every client sends."""

    samples: np.ndarray
    newtons: np.ndarray
    rows: int
    frames: int
    frame_s: float
    inputs: tuple[str, ...]

    def frame(self, number: int) -> np.ndarray:
        """Return one frame's samples."""
        return self.samples[number * self.rows : (number + 1) * self.rows]


@dataclass
class Seen:
    """What came back."""

    latencies_s: list[float] = field(default_factory=list)
    estimates: int = 0
    wrong: int = 0
    missing: int = 0


def main() -> None:
    """Measure each link in turn and print one table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--model", type=Path, default=Path("models/hybrid"))
    options.add_argument("--recordings", type=Path, default=Path("data/processed/test"))
    options.add_argument("--sessions", type=int, default=10)
    options.add_argument("--frame-ms", type=float, default=20.0)
    options.add_argument("--seconds", type=float, default=12.0)
    given = options.parse_args()
    load = load_of(given)
    cores = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder, Mosquitto(Path(folder), *BROKER) as broker:
        port = free_port()
        settings = {"mqtt": {"broker": {"port": broker.port}}}
        with running(given.model, Path(folder) / "live", port, settings, cores[:1]) as process:
            service = psutil.Process(process.pid)
            os.sched_setaffinity(0, cores[1:] or cores)
            ws = f"ws://127.0.0.1:{port}/stream"
            mqtt = f"mqtt://127.0.0.1:{broker.port}/cylinder-friction/NAME"

            def publisher(qos: int) -> Callable[[int, Seen], None]:
                return lambda number, seen: publish(broker.port, number, qos, load, seen)

            def client(url: str) -> Callable[[int, Seen], None]:
                return lambda number, seen: send(url.replace("NAME", f"press{number}"), f"press {number}", load, seen)

            runs: list[tuple[str, Callable[[int, Seen], None], bool]] = [
                ("WebSocket", client(ws), False),
                ("MQTT", client(mqtt), False),
                ("MQTT, broker killed", client(mqtt), True),
                ("... QoS 1, no acknowledgements", publisher(1), True),
                ("... QoS 0, no acknowledgements", publisher(0), True),
            ]
            print(
                f"{given.sessions} sessions, frames of {given.frame_ms:g} ms, {given.seconds:g} s each, load of the "
                f"machine {os.getloadavg()[0]:.1f}\n"
                f"{'':31} median     99 %    core  broker's  estimates  missing  wrong"
            )
            for place, (name, work, kill) in enumerate(runs):
                measure(name, given.sessions, place, work, load, service, broker if kill else None, broker)


def load_of(given: argparse.Namespace) -> Load:
    """Return samples and what a stream of its own makes of them."""
    estimator = load_estimator(given.model)
    inputs = tuple(estimator.inputs)
    rows = max(1, round(1e-3 * given.frame_ms / float(estimator.sample_time_s or 0.005)))
    frames = int(given.seconds / (1e-3 * given.frame_ms))
    samples = read_recordings(given.recordings)[0].samples(inputs)
    samples = np.tile(samples, (-(-frames * rows // len(samples)), 1))[: frames * rows]
    return Load(samples, estimator.real_time().run(samples)[0], rows, frames, 1e-3 * given.frame_ms, inputs)


def measure(
    name: str,
    sessions: int,
    place: int,
    work: Callable[[int, Seen], None],
    load: Load,
    service: psutil.Process,
    killed: Mosquitto | None,
    broker: Mosquitto,
) -> None:
    """Run one thread per session and print a line."""
    seen = [Seen() for _ in range(sessions)]
    threads = [threading.Thread(target=work, args=(1000 * place + each, seen[each])) for each in range(sessions)]
    broker_s = cpu_s(psutil.Process(broker.pid)) if killed is None else 0.0
    before_s, begin_s = cpu_s(service), time.monotonic()
    for thread in threads:
        thread.start()
    if killed is not None:
        time.sleep(0.4 * load.frames * load.frame_s)
        killed.kill()
        time.sleep(AWAY_S)
        killed.start()
    for thread in threads:
        thread.join()
    lasted_s = time.monotonic() - begin_s
    latencies_s = [late for each in seen for late in each.latencies_s]
    times = (
        "{:4.1f} ms {:5.1f} ms".format(*1e3 * np.quantile(latencies_s, (0.5, 0.99))) if latencies_s else f"{'-':>16}"
    )
    share = 100.0 * (cpu_s(service) - before_s) / lasted_s
    used_s = cpu_s(psutil.Process(broker.pid)) - broker_s
    brokers = f"{100.0 * used_s / lasted_s:7.1f} %" if killed is None else f"{'-':>9}"
    expected = sessions * load.frames * load.rows
    got, missing, wrong = (sum(getattr(each, key) for each in seen) for key in ("estimates", "missing", "wrong"))
    print(
        f"{name:31} {times} {share:5.1f} % {brokers} {100.0 * got / expected:8.2f} % {missing:8d} {wrong:6d}",
        flush=True,
    )


def cpu_s(process: psutil.Process) -> float:
    """Return the processor time that a process has used."""
    return sum(process.cpu_times()[:2])


def send(url: str, session: str, load: Load, seen: Seen) -> None:
    """Send all frames in their time by our client, and take in what comes back."""
    sent_s = np.zeros(load.frames)
    with Client(url, session, load.frame_s / load.rows, load.inputs) as client:
        begin_s = time.monotonic()
        for number in range(load.frames):
            while (left_s := begin_s + number * load.frame_s - time.monotonic()) > 0.0:
                take(client, left_s, load, sent_s, seen)
            sent_s[number] = time.monotonic()
            client.send(load.frame(number))
        client.wait_until_kept()
        while take(client, 1.0, load, sent_s, seen):
            pass


def take(client: Client, timeout_s: float, load: Load, sent_s: np.ndarray, seen: Seen) -> int:
    """Take in the next estimates; return how many."""
    index, newtons, flags = client.estimates(timeout_s)
    count = len(flags)
    if count:
        seen.latencies_s.append(time.monotonic() - sent_s[(index + count - 1) // load.rows])
        seen.estimates += count
        seen.wrong += count * (newtons.tobytes() != load.newtons[index : index + count].tobytes())
    return count


def publish(port: int, number: int, qos: int, load: Load, seen: Seen) -> None:
    """Publish all frames in their time and never look back; then ask how many samples were missing."""
    session = f"press {number}"
    opens = {"session": session, "inputs": load.inputs, "sample_time_s": load.frame_s / load.rows}
    client, replies = PahoClient(CallbackAPIVersion.VERSION2, protocol=MQTTv5), list[dict[str, Any]]()
    topic = f"cylinder-friction/press{number}"

    def opened(count: int) -> dict[str, Any]:
        while len(replies) < count:
            client.publish(f"{topic}/in", json.dumps({"open": opens}), qos=1)
            time.sleep(0.5)
        return dict(replies[-1]["opened"])

    def connected(*_: object) -> None:
        client.subscribe(f"{topic}/out", 1)

    client.on_connect = connected
    client.on_message = lambda _client, _data, message: note_text(bytes(message.payload), replies)
    client.connect("127.0.0.1", port)
    client.loop_start()
    handle, begin_s = int(opened(1)["handle"]), time.monotonic()
    for frame in range(load.frames):
        time.sleep(max(0.0, begin_s + frame * load.frame_s - time.monotonic()))
        block = SampleBlock(handle, frame * load.rows, time.time(), load.frame(frame))
        client.publish(f"{topic}/in", pack_samples(block), qos=qos)
    time.sleep(2.0)
    counts = opened(len(replies) + 1)["counts"]
    client.disconnect()
    client.loop_stop()
    seen.missing = counts["missing"] + counts["skipped"]
    seen.estimates = counts["stepped"]


def note_text(payload: bytes, replies: list[dict[str, Any]]) -> None:
    """Keep what opens a session."""
    if payload.startswith(b'{"opened"'):
        replies.append(json.loads(payload))


if __name__ == "__main__":
    main()
