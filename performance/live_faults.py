"""Faults on the wire: generated frames, each with one of ten faults or none, against the documented rules.

    python performance/live_faults.py [--frames 100000] [--over-websocket 5000]

In one process, a connection reads the frames from a transport in memory; every estimate is compared, bit for bit, with
the estimator's own step on the samples as the rules order them, and every sample is counted once. Then frames of the
same kind go to a service of its own over WebSocket, on connections that come and go, and are compared in the same way.
Prints what happened to how many samples.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import urllib.request
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from live_service import running
from websockets.sync.client import ClientConnection, connect

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # the frames and the rules, as tested

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.live.engine import Engine
from cylinder_friction.live.engine_building import built_engine
from cylinder_friction.live.journal import Journal
from cylinder_friction.live.settings import SessionRules
from cylinder_friction.network.ports import free_port
from cylinder_friction.recordings.storage import read_recordings
from wire_faults import (
    FAULTS,
    SESSIONS,
    ExpectedSession,
    Frame,
    estimates_of,
    follow,
    frames,
    on_the_wire,
    run_faulty,
)

SIZE = 200


def main() -> None:
    """Run both parts."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--model", type=Path, default=Path("models/hybrid"))
    options.add_argument("--recordings", type=Path, default=Path("data/processed/test"))
    options.add_argument("--frames", type=int, default=100_000)
    options.add_argument("--over-websocket", type=int, default=5000)
    chosen = options.parse_args()
    estimator = load_estimator(chosen.model)
    samples = read_recordings(chosen.recordings)[0].samples(estimator.inputs)
    with tempfile.TemporaryDirectory() as folder:
        in_memory(estimator, samples, chosen.frames, Path(folder))
        over_websocket(chosen.model, estimator, samples, chosen.over_websocket, Path(folder))


def in_memory(estimator: FrictionEstimator, samples: np.ndarray, count: int, folder: Path) -> None:
    """Run frames through a connection in memory."""
    engine, journal = Engine(built_engine(estimator, folder)), Journal(folder / "journal.db")
    seen: Counter[str] = Counter()

    @settings(
        max_examples=count // (SIZE // 2), deadline=None, suppress_health_check=list(HealthCheck), database=None,
        phases=[Phase.generate, Phase.shrink],
    )  # fmt: skip
    @given(frames(SIZE // 2, SIZE))
    def check(sent: list[Frame]) -> None:
        outcome = run_faulty(sent, engine, journal, estimator.real_time, samples)
        assert outcome.refused == outcome.expected_refused
        seen.update(frames=len(sent), messages=outcome.messages, refused=outcome.refused)
        for got, counts, expected in zip(outcome.got, outcome.counts, outcome.expected, strict=True):
            assert got == expected.estimates
            assert {name: counts[name] for name in expected.counts} == dict(expected.counts)
            seen.update(estimates=len(got), **expected.counts)

    check()
    journal.close()
    print("in memory, all as the rules have it: " + ", ".join(f"{name} {each:,}" for name, each in seen.items()))


def over_websocket(model: Path, estimator: FrictionEstimator, samples: np.ndarray, count: int, folder: Path) -> None:
    """Send frames to a service of its own, over connections that come and go."""
    port, chance, messages, estimates, refused = free_port(), np.random.default_rng(0), 0, 0, 0
    rules = SessionRules(
        hold_s=3600.0, hold_rows=150, short_gap_s=0.25
    )  # no clock decides, so that all can be compared
    sample_time_s = float(estimator.sample_time_s or 0.0)
    opens = {"inputs": list(estimator.inputs), "sample_time_s": sample_time_s}
    with running(model, folder / "service", port, {"rules": asdict(rules)}):
        for begin in range(0, count, 500):
            drawn = chance.integers((0, 1, 0, 0), (SESSIONS, 30, len(FAULTS), 2**32), (500, 4)).tolist()
            sent = [Frame(session, rows, FAULTS[fault], seed, 0.0) for session, rows, fault, seed in drawn]
            with connect(f"ws://127.0.0.1:{port}/stream", max_size=None, close_timeout=0.1) as socket:
                handles = []
                for place in range(SESSIONS):
                    socket.send(json.dumps({"open": {"session": f"{begin} {place}", **opens}}))
                    handles.append(int(json.loads(socket.recv())["opened"]["handle"]))
                wire = on_the_wire(sent, handles, samples)
                for _, message in wire:
                    socket.send(message)
                replies = list(until_quiet(socket))
            expected = [ExpectedSession(estimator.real_time(), sample_time_s, rules) for _ in handles]
            refused += follow(wire, handles, expected)
            assert estimates_of(replies, handles) == [each.estimates for each in expected]
            messages += len(wire)
            estimates += sum(len(each.estimates) for each in expected)
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as reply:
            lines = [each for each in reply.read().decode().splitlines() if "live_refused_total{" in each]
    counted = sum(float(each.rpartition(" ")[2]) for each in lines)
    assert counted == refused, f"{counted} refused, expected {refused}"
    print(
        f"over WebSocket, all as the rules have it: messages {messages:,}, refused {refused:,}, estimates {estimates:,}"
    )


def until_quiet(socket: ClientConnection) -> Iterator[bytes | str]:
    """Yield what comes until nothing does for a second."""
    try:
        while True:
            yield socket.recv(timeout=1.0)
    except TimeoutError:
        return


if __name__ == "__main__":
    main()
