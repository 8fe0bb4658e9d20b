"""Load on the served model, next to its peers, in one run.

    python performance/serving_load.py [--run FOLDER] [--rounds 5] [--seconds 3]

Four servers with one worker process each, all with the champion of a finished run: ``cylinder-friction serve``, with
its access log, a minimal FastAPI application with the same graph (``serving_peers.py``), without one, ``mlflow models
serve`` with the model, and with a model that computes nothing. The servers share one core; the load comes from a
process of its own on another, over kept connections. Rounds alternate between the servers. Prints medians, how much
longer our layer takes than each peer by wall clock and by the server's CPU time (on a busy machine the steadier one),
the memory of all of a server's processes, and what costly requests take.
"""

from __future__ import annotations

import argparse
import http.client
import json
import os
import selectors
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
import warnings
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil
import pyarrow as pa
from serving_peers import ECHO

from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.tracking.model_folder import artifact_path, download_model, version_of
from cylinder_friction.tracking.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator

CHAMPION = "models:/friction-estimator@champion"
JSON, ARROW = "application/json", "application/vnd.apache.arrow.stream"
CONNECTIONS = 4
START_S = 120.0
OURS = "cylinder-friction serve"
Samples = np.ndarray[Any, np.dtype[np.float64]]


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


def arrow(samples: Samples) -> bytes:
    sink = pa.BufferOutputStream()
    table = pa.table(dict(zip(SAMPLE_COLUMNS, samples.T, strict=True)))
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())


def generate(port: int, path: str, content_type: str, seconds: float) -> None:
    """Send the body on standard input over kept connections for some seconds; print how often it was served."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    body = sys.stdin.buffer.read()
    head = f"POST {path} HTTP/1.1\r\nHost: x\r\nContent-Type: {content_type}\r\nContent-Length: {len(body)}\r\n\r\n"
    request = head.encode() + body
    waiting = selectors.DefaultSelector()
    for _ in range(CONNECTIONS):
        connection = socket.create_connection(("127.0.0.1", port))
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        waiting.register(connection, selectors.EVENT_READ)
        connection.sendall(request)
    began, served = time.perf_counter(), 0
    while waiting.get_map():
        for key, _ in waiting.select():
            connection = key.fileobj  # type: ignore[assignment]
            response(connection)
            served += 1
            if time.perf_counter() - began < seconds:
                connection.sendall(request)
            else:
                waiting.unregister(connection)
                connection.close()
    sys.stdout.write(json.dumps({"served": served, "seconds": time.perf_counter() - began}))


def response(connection: socket.socket) -> bytes:
    """Return the body of one response; end where it is an error."""
    received = bytearray()
    while (end := received.find(b"\r\n\r\n")) < 0:
        received += connection.recv(1 << 18) or sys.exit("the server closed the connection")
    head = bytes(received[:end]).lower()
    if b" 200 " not in head.split(b"\r\n", 1)[0]:
        sys.exit(received.decode(errors="replace")[:2000])
    length = int(head.split(b"content-length:")[1].split(b"\r\n")[0])
    while len(received) < end + 4 + length:
        received += connection.recv(1 << 20) or sys.exit("the server closed the connection")
    return bytes(received[end + 4 :])


@contextmanager
def running(
    name: str, command: list[str], port: int, environment: dict[str, str], folder: Path, ready: str = "/ping"
) -> Iterator[Server]:
    """Yield the server once it is ready."""
    log = folder / f"{port}.log"
    with log.open("w") as output:
        process = subprocess.Popen(
            command,
            preexec_fn=lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}),
            env={**os.environ, **environment},
            cwd=folder,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
        try:
            deadline = time.monotonic() + START_S
            while True:
                try:
                    urllib.request.urlopen(f"http://127.0.0.1:{port}{ready}", timeout=5.0).close()
                    break
                except OSError as error:
                    if process.poll() is not None or time.monotonic() > deadline:
                        raise SystemExit(f"{name} was not ready:\n{log.read_text('utf-8')}") from error
                    time.sleep(0.2)
            yield Server(name, port, process)
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()


@contextmanager
def servers(model: Path, folder: Path) -> Iterator[list[Server]]:
    """Yield all servers, ready."""
    import mlflow

    code = folder / "echo.py"
    code.write_text(ECHO, "utf-8")
    signature = mlflow.models.Model.load(str(model)).signature
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # there is no input example
        mlflow.pyfunc.save_model(folder / "echo", python_model=str(code), signature=signature, pip_requirements=[])
    here = str(Path(__file__).parent)
    python, environment = sys.executable, {"GRAPH": str(artifact_path(model, "graph"))}
    plain = ["-m", "mlflow", "models", "serve", "--env-manager", "local", "-w", "1", "-m"]
    commands = {
        OURS: ["-m", "cylinder_friction.commands.cli", "serve", str(model), "--access-log", "access.jsonl", "--port"],
        "FastAPI + ONNX": [
            *("-m", "uvicorn", "--app-dir", here, "--factory", "serving_peers:application", "--no-access-log"),
            *("--log-level", "warning", "--port"),
        ],
        "mlflow models serve": [*plain, str(model), "-p"],
        "MLflow echo": [*plain, str(folder / "echo"), "-p"],
    }
    with ExitStack() as stack:
        found = []
        for name, command in commands.items():
            port = free_port()
            found.append(stack.enter_context(running(name, [python, *command, str(port)], port, environment, folder)))
        found[0].paths[ARROW] = "/invocations"
        found[1].paths[ARROW] = "/arrow"
        yield found


def load(server: Server, work: Work, seconds: float) -> tuple[float, float]:
    """Return requests per second, and CPU seconds of the server per request."""
    before_s = server.cpu_s()
    command = [sys.executable, __file__, "--generate", str(server.port), server.paths[work.content_type]]
    done = subprocess.run(
        [*command, work.content_type, str(seconds)], input=work.body, stdout=subprocess.PIPE, check=True
    )
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
            print(
                f"  {name:32s}{per_second:12.0f}{per_second * work.rows:12.0f}{1e3 * cpu_s:10.3f}"
                f"{ratio:18.2f}{cpu_ratio:8.2f}"
            )
    print()
    for server in found:
        print(f"{server.name:26s} {server.memory_mb():6.0f} MB after the load")


def costly(found: list[Server], run: Path) -> None:
    """Print what unusual requests take, of those that the model is served by."""
    samples = next(iter(read_stored(run / "data/processed/test"))).samples()
    bodies = {
        "20,000 rows, one name of 10,000 characters": named_rows(samples, 20_000, "n" * 10_000),
        "20 MB of 0xff": b"\xff" * 20_000_000,
        "200,000 rows": named_rows(samples, 200_000),
    }
    for title, body in bodies.items():
        print(f"\n{title} ({len(body) / 1e6:.1f} MB){'status':>10s}{'response, bytes':>18s}{'memory, MB more':>18s}")
        for server in found:
            before_kb = reset_peak(server)
            status, content = ask(server.port, body)
            peak_kb = sum(peak_of(each.pid) for each in server.tree())
            print(f"  {server.name:32s}{status:10d}{len(content):18d}{(peak_kb - before_kb) / 1e3:18.0f}")
    print()
    for server in found:
        print(f"{server.name:26s} {server.memory_mb():6.0f} MB after these requests")


def named_rows(samples: Samples, rows: int, first_name: str = "first") -> bytes:
    """Return a request with the recording again and again, each time under another name; the first row has its own."""
    repeated = enumerate(np.resize(samples, (rows, samples.shape[1])).tolist())
    data = [[*row, str(number // len(samples))] for number, row in repeated]
    data[0][-1] = first_name
    return json.dumps({"dataframe_split": {"columns": [*SAMPLE_COLUMNS, "recording"], "data": data}}).encode()


def ask(port: int, body: bytes, content_type: str = JSON) -> tuple[int, bytes]:
    """Return status and body of the response to one request."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120.0)
    try:
        connection.request("POST", "/invocations", body, {"Content-Type": content_type})
        response = connection.getresponse()
        return response.status, response.read()
    finally:
        connection.close()


def reset_peak(server: Server) -> int:
    """Let the kernel measure peaks anew; return what all processes of a server have now [kB]."""
    for each in server.tree():
        Path(f"/proc/{each.pid}/clear_refs").write_text("5", "utf-8")
    return sum(peak_of(each.pid) for each in server.tree())


def peak_of(pid: int) -> int:
    """Return the most memory of a process since ``reset_peak`` [kB]; 0 where it has ended."""
    found = Path(f"/proc/{pid}/status").read_text("utf-8").partition("VmHWM:")[2].split()
    return int(found[0]) if found else 0


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
            costly([found[0], found[2]], run)


if __name__ == "__main__":
    main()
