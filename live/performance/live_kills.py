"""The live service killed again and again under load: no differing bit, no lost sample, and how soon it goes on.

Every session has a client of its own, which sends in the model's own time. Each turn ends the service at a random
moment and starts it anew at once. At the end what the clients got, and what lies in the history, is compared with a
stream of each session's own.

    PYTHONPATH=performance python live/performance/live_kills.py --kills 100
"""

import argparse
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction_live.client import Client
from live_service import arguments, running

PORT, BLOCK_S, POLL_S = free_port(), 0.05, 0.005
PATIENT = {"limits": {"loop_lag_s": 60.0}}
"""Settings of a service that refuses no session because the machine is busy."""


@dataclass
class Cylinder:
    """What one session's client sent and got."""

    name: str
    begin: int  # Its samples begin here in the recording, so that sessions differ
    newtons: list[np.ndarray] = field(default_factory=list)
    indices: list[int] = field(default_factory=list)
    sent: int = 0
    goal: int = 0  # Index of the first sample that was sent after the latest end of the service
    reached_s: float = 0.0  # When its newtons came; 0: not yet
    error: str = ""


def main() -> int:
    """Run it, print one table, return 1 where anything differs."""
    options = arguments(__doc__, sessions=50)
    options.add_argument("--kills", type=int, default=100)
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    estimator = load_estimator(given.model)
    step_s = float(estimator.sample_time_s or 0.005)
    rows = max(1, round(BLOCK_S / step_s))
    recorded = read_stored(given.recordings)[0].samples(estimator.inputs)
    cylinders = [Cylinder(f"press {place}", 17 * place) for place in range(given.sessions)]
    stop = threading.Event()
    with tempfile.TemporaryDirectory() as name, ExitStack() as services:
        folder = Path(name)
        start = partial(running, given.model, folder, PORT, PATIENT, poll_s=POLL_S)
        service = services.enter_context(start())
        threads = [
            threading.Thread(target=send, args=(each, recorded, tuple(estimator.inputs), step_s, rows, stop))
            for each in cylinders
        ]
        for thread in threads:
            thread.start()
        try:
            service, times = kill_again_and_again(
                given, service, lambda: services.enter_context(start()), cylinders, rows
            )
        finally:
            if any(each.error for each in cylinders):
                stop.set()
                service.kill()
        stop.set()
        for thread in threads:
            thread.join()
        service.send_signal(signal.SIGTERM)
        service.wait()
        while sqlite3.connect(folder / "journal.db").execute("SELECT COUNT(*) FROM chunk").fetchone()[0]:
            with start() as service:  # it moves what is left into the history
                service.send_signal(signal.SIGTERM)
                service.wait()
        problems = compare(cylinders, recorded, estimator, folder / "history")
    samples = sum(each.sent for each in cylinders)
    print(f"{given.sessions} sessions, {samples:,} samples, {len(times)} times killed")
    measured = ("kill to exit", "start to ready", "to newtons of the first session", "of the last session")
    for what, column in zip(measured, np.array(times).T, strict=True):
        print(f"{what:<32} median {np.median(column):.2f} s, worst {column.max():.2f} s")
    print("differing bits, lost samples: " + ("none" if not problems else "; ".join(problems[:5])))
    return int(bool(problems))


def send(
    cylinder: Cylinder, recorded: np.ndarray, inputs: tuple[str, ...], step_s: float, rows: int, stop: threading.Event
) -> None:
    """Send in the model's time until ``stop``, then wait until all is kept and estimated."""
    try:
        with Client(f"ws://127.0.0.1:{PORT}/stream", cylinder.name, step_s, inputs) as client:
            begun_s = time.monotonic()
            while not stop.is_set():
                client.send(samples_of(cylinder, recorded, cylinder.sent, rows))
                cylinder.sent += rows
                take(client, cylinder, 0.0)
                time.sleep(max(0.0, begun_s + cylinder.sent * step_s - time.monotonic()))
            client.wait_until_kept()
            while len(cylinder.indices) < cylinder.sent and take(client, cylinder, 5.0):
                pass
    except Exception as error:  # reported in the table
        cylinder.error = f"{cylinder.name}: {type(error).__name__} {error}"


def samples_of(cylinder: Cylinder, recorded: np.ndarray, begin: int, rows: int) -> np.ndarray:
    """Return a session's samples, the recording again and again."""
    return recorded[(cylinder.begin + np.arange(begin, begin + rows)) % len(recorded)]


def take(client: Client, cylinder: Cylinder, timeout_s: float) -> bool:
    """Take estimates that are there; return whether there were any."""
    any_came = False
    while len(part := client.estimates(timeout_s)[1]):
        cylinder.indices += range(len(cylinder.indices), len(cylinder.indices) + len(part))
        cylinder.newtons.append(part)
        if len(cylinder.indices) > cylinder.goal and not cylinder.reached_s:
            cylinder.reached_s = time.monotonic()
        any_came, timeout_s = True, 0.0
    return any_came


def kill_again_and_again(
    given: argparse.Namespace,
    service: subprocess.Popen[bytes],
    start: Callable[[], subprocess.Popen[bytes]],
    cylinders: list[Cylinder],
    rows: int,
) -> tuple[subprocess.Popen[bytes], list[tuple[float, float, float, float]]]:
    """Return the last service, and of each turn the seconds to exit, to ready, to the first and to all newtons."""
    times, draw = [], np.random.default_rng(given.seed)
    for _ in range(given.kills):
        time.sleep(draw.uniform(0.1, 2.5))
        begun_s = time.monotonic()
        service.kill()
        service.wait()
        ended_s = time.monotonic()
        for each in cylinders:
            each.goal, each.reached_s = each.sent + rows, 0.0  # what is being sent just now may have come
        service = start()
        ready_s = time.monotonic()
        while not all(each.reached_s for each in cylinders) and not any(each.error for each in cylinders):
            time.sleep(0.002)
        if errors := [each.error for each in cylinders if each.error]:
            raise RuntimeError("; ".join(errors))
        reached_s = np.array([each.reached_s for each in cylinders])
        times.append((ended_s - begun_s, ready_s - ended_s, reached_s.min() - ended_s, reached_s.max() - ended_s))
    return service, times


def compare(cylinders: list[Cylinder], recorded: np.ndarray, estimator: object, history: Path) -> list[str]:
    """Return what differs."""
    problems = [each.error for each in cylinders if each.error]
    for each in cylinders:
        expected, _ = estimator.real_time().run(samples_of(each, recorded, 0, each.sent))  # type: ignore[attr-defined]
        got = np.concatenate(each.newtons)
        if not np.array_equal(got, expected):
            problems.append(f"{each.name}: clients got {len(got)} of {each.sent}, or other newtons")
        files = sorted((history / each.name.replace(" ", "%20")).rglob("*.parquet"))
        table = pd.concat([pd.read_parquet(path) for path in files])
        indices, kept = table["index"].to_numpy(), table[["friction_n", "lower_n", "upper_n"]].to_numpy()
        if not (np.array_equal(indices, np.arange(each.sent)) and np.array_equal(kept, expected)):
            problems.append(f"{each.name}: the history has {len(indices)} of {each.sent}, or other newtons")
    return problems


if __name__ == "__main__":
    sys.exit(main())
