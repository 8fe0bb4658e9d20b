"""Load on the served model, next to its peers, in one run.

    python performance/serving_load.py [--run FOLDER] [--rounds 5] [--seconds 3]

Three servers with one worker process each, all with the champion of a finished run: ``cylinder-friction serve``, with
its access log, a minimal FastAPI application with the same graph (``serving_peers.py``), without one, and ``mlflow
models serve``. The servers share one core; the load comes from a process of its own on another, over kept connections.
Rounds alternate between the servers. Prints medians, how much longer our layer takes than each peer by wall clock and
by the server's CPU time (on a busy machine the steadier one), and the memory of all of a server's processes.
"""

import argparse
import http.client
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil
import pyarrow as pa
from service_process import CLI, ready

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.tracking.model_folder import artifact_path, download_model, version_of
from cylinder_friction.tracking.store import open_store

CHAMPION = "models:/friction-estimator@champion"
JSON, ARROW = "application/json", "application/vnd.apache.arrow.stream"
CONNECTIONS = 4
OURS = "cylinder-friction serve"


@dataclass
class Server:
    """A running server."""

    name: str
    port: int
    process: subprocess.Popen[bytes]
    paths: dict[str, str] = field(default_factory=lambda: {JSON: "/invocations"})

    def tree(self) -> list[psutil.Process]:
        top = psutil.Process(self.process.pid)
        return [each for each in (top, *top.children(recursive=True)) if each.status() != psutil.STATUS_ZOMBIE]

    def memory_mb(self) -> float:
        return sum(each.memory_full_info().pss for each in self.tree()) / 1e6

    def cpu_s(self) -> float:
        return sum(sum(each.cpu_times()[:2]) for each in self.tree())


@dataclass(frozen=True)
class Work:
    """One kind of request."""

    name: str
    rows: int
    content_type: str
    body: bytes


def works(run: Path) -> list[Work]:
    """Return the requests: rows of a held-out recording."""
    samples = np.concatenate([recording.samples() for recording in read_stored(run / "data/processed/test")])
    found = []
    for rows, content_type in ((40, JSON), (200, JSON), (12_000, JSON), (12_000, ARROW)):
        part = samples[:rows]
        table = {"columns": list(SAMPLE_COLUMNS), "data": part.tolist()}
        body = json.dumps({"dataframe_split": table}).encode() if content_type == JSON else arrow(part)
        found.append(Work(f"{rows} rows, {'JSON' if content_type == JSON else 'Arrow'}", rows, content_type, body))
    return found


def arrow(samples: Array) -> bytes:
    sink = pa.BufferOutputStream()
    table = pa.table(dict(zip(SAMPLE_COLUMNS, samples.T, strict=True)))
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())


def generate(port: int, path: str, content_type: str, seconds: float) -> None:
    """Send the body on standard input over kept connections for some seconds; print how often it was served."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    body = sys.stdin.buffer.read()
    began_s = time.perf_counter()

    def served(_: int) -> int:
        connection, count = http.client.HTTPConnection("127.0.0.1", port), 0
        while time.perf_counter() - began_s < seconds:
            connection.request("POST", path, body, {"Content-Type": content_type})
            response = connection.getresponse()
            content, count = response.read(), count + 1
            if response.status != http.client.OK:
                sys.exit(content.decode(errors="replace")[:2000])
        return count

    with ThreadPoolExecutor(CONNECTIONS) as threads:
        total = sum(threads.map(served, range(CONNECTIONS)))
    sys.stdout.write(json.dumps({"served": total, "seconds": time.perf_counter() - began_s}))


@contextmanager
def servers(model: Path, folder: Path) -> Iterator[list[Server]]:
    """Yield all servers, ready."""
    python = sys.executable
    peer = ("-m", "uvicorn", "--app-dir", str(Path(__file__).parent), "--factory", "serving_peers:application")
    commands = {
        OURS: [*CLI, "serve", str(model), "--access-log", "access.jsonl", "--port"],
        "FastAPI + ONNX": [python, *peer, "--no-access-log", "--log-level", "warning", "--port"],
        "mlflow models serve": [
            *(python, "-m", "mlflow", "models", "serve", "--env-manager", "local", "-w", "1", "-m", str(model), "-p")
        ],
    }
    environment = {**os.environ, "GRAPH": str(artifact_path(model, "graph"))}
    core = [min(os.sched_getaffinity(0))]
    with ExitStack() as stack:
        found = []
        for name, command in commands.items():
            port = free_port()
            started = ready([*command, str(port)], port, "/ping", core, env=environment, cwd=folder)
            found.append(Server(name, port, stack.enter_context(started)))
        found[0].paths[ARROW] = "/invocations"
        found[1].paths[ARROW] = "/arrow"
        yield found


def load(server: Server, work: Work, seconds: float) -> tuple[float, float]:
    """Return requests per second, and CPU seconds of the server per request."""
    before_s = server.cpu_s()
    sent = [server.paths[work.content_type], work.content_type, str(seconds)]
    command = [sys.executable, __file__, "--generate", str(server.port), *sent]
    done = subprocess.run(command, input=work.body, stdout=subprocess.PIPE, check=True)
    result = json.loads(done.stdout)
    return result["served"] / result["seconds"], (server.cpu_s() - before_s) / result["served"]


def table(found: list[Server], run: Path, rounds: int, seconds: float) -> None:
    """Print the load table."""
    for server in found:
        print(f"{server.name:26s} {server.memory_mb():6.0f} MB in {len(server.tree())} processes before any load")
    for work in works(run):
        taking = [server for server in found if work.content_type in server.paths]
        figures: dict[str, list[tuple[float, float]]] = {server.name: [] for server in taking}
        for _ in range(rounds):
            for server in taking:
                figures[server.name].append(load(server, work, seconds))
        print(f"\n{work.name:34s}{'requests/s':>12s}{'rows/s':>12s}{'CPU ms':>10s}{'ours takes, wall':>18s}{'CPU':>8s}")
        for name, values in figures.items():
            per_second, cpu_s = (statistics.median(column) for column in zip(*values, strict=True))
            pairs = list(zip(figures[OURS], values, strict=True))
            ratio = statistics.median(theirs[0] / ours[0] for ours, theirs in pairs)
            cpu_ratio = statistics.median(ours[1] / theirs[1] for ours, theirs in pairs)
            print(f"  {name:32s}{per_second:12.0f}{per_second * work.rows:12.0f}", end="")
            print(f"{1e3 * cpu_s:10.3f}{ratio:18.2f}{cpu_ratio:8.2f}")
    print()
    for server in found:
        print(f"{server.name:26s} {server.memory_mb():6.0f} MB after the load")


def main() -> None:
    """Print the figures."""
    if sys.argv[1:2] == ["--generate"]:
        port, path, content_type, seconds = sys.argv[2:]
        generate(int(port), path, content_type, float(seconds))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each server, request and round")
    options = parser.parse_args()
    run = options.run.resolve()
    with tempfile.TemporaryDirectory() as scratch:
        with open_store(run) as store:
            model = download_model(store, version_of(store, CHAMPION), Path(scratch) / "model")
        with servers(model, Path(scratch)) as found:
            table(found, run, options.rounds, options.seconds)


if __name__ == "__main__":
    main()
