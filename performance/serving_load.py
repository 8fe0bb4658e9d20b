"""Load on `mlflow models serve`: the served model of this checkout beside that of an older commit, in one run.

    python performance/serving_load.py [--estimator FOLDER] [--before COMMIT] [--rounds 5] [--seconds 3]

Both servers hold the same estimator, with one worker each, and share one core; the load comes from a process of its own
on another, over kept connections. Rounds alternate between the servers. The rows sweep the training range. Prints
medians of requests per second and of the server's CPU time per request, the ratio of CPU times, and the memory of all
of a server's processes. On a busy machine the CPU time is the steadier figure.
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
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from cylinder_friction.deployment.child_server import child_server
from cylinder_friction.deployment.golden_recording import golden_content
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.execution.ports import free_port

ROOT = Path(__file__).parents[1]
NOW, ROWS, CONNECTIONS = "this checkout", (40, 200, 12_000), 4
SAVE = """
import json, sys
from pathlib import Path
import pandas as pd
from mlflow.models import Model
try:
    from cylinder_friction.deployment.served_model import save_model_folder
except ImportError:  # of an older commit
    from cylinder_friction.tracking.model_folder import save_model_folder
save_model_folder(Path(sys.argv[1]), Path(sys.argv[2]), {}, pd.DataFrame(**json.load(sys.stdin)), Model())
"""
"""Logs an estimator with the code of a commit."""


@dataclass
class Server:
    """A running server."""

    name: str
    port: int
    process: subprocess.Popen[bytes]

    def tree(self) -> list[psutil.Process]:
        top = psutil.Process(self.process.pid)
        return [each for each in (top, *top.children(recursive=True)) if each.status() != psutil.STATUS_ZOMBIE]

    def memory_mb(self) -> float:
        return sum(each.memory_full_info().pss for each in self.tree()) / 1e6

    def cpu_s(self) -> float:
        return sum(sum(each.cpu_times()[:2]) for each in self.tree())


def bodies(estimator: Path) -> dict[int, bytes]:
    """Return the requests by their number of rows."""
    model = load_estimator(estimator).step_model()
    samples = np.tile(golden_content(model)["samples"], (max(ROWS) // 800, 1))  # it begins where it ends
    tables = {rows: {"columns": list(model.inputs), "data": samples[:rows].tolist()} for rows in ROWS}
    return {rows: json.dumps({"dataframe_split": table}).encode() for rows, table in tables.items()}


def generate(port: int, seconds: float) -> None:
    """Send the body on standard input over kept connections for some seconds; print how often it was answered."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(os.getppid()))})
    body, began_s = sys.stdin.buffer.read(), time.perf_counter()

    def answered(_: int) -> int:
        connection, count = http.client.HTTPConnection("127.0.0.1", port), 0
        while time.perf_counter() - began_s < seconds:
            connection.request("POST", "/invocations", body, {"Content-Type": "application/json"})
            response = connection.getresponse()
            content, count = response.read(), count + 1
            if response.status != http.client.OK:
                sys.exit(content.decode(errors="replace")[:2000])
        return count

    with ThreadPoolExecutor(CONNECTIONS) as threads:
        total = sum(threads.map(answered, range(CONNECTIONS)))
    sys.stdout.write(json.dumps({"answered": total, "seconds": time.perf_counter() - began_s}))


@contextmanager
def servers(estimator: Path, commit: str, example: bytes, scratch: Path) -> Iterator[list[Server]]:
    """Yield both servers, ready."""
    sources = {commit: scratch / "source", NOW: ROOT}
    sources[commit].mkdir()
    unpack = ["bash", "-o", "pipefail", "-c", 'git archive "$0" src | tar -x -C "$1"', commit, str(sources[commit])]
    subprocess.run(unpack, cwd=ROOT, check=True)
    with ExitStack() as stack:
        found = []
        for number, (name, source) in enumerate(sources.items()):
            model, port = scratch / f"model{number}", free_port()
            variables = {"PYTHONPATH": str(source / "src")}
            save = [sys.executable, "-c", SAVE, str(model), str(estimator.resolve())]
            subprocess.run(save, input=example, check=True, cwd=scratch, env={**os.environ, **variables})
            command = [sys.executable, "-m", "mlflow", "models", "serve", "--env-manager", "local", "-w", "1"]
            command += ["-m", str(model), "--port", str(port)]
            url, log = f"http://127.0.0.1:{port}/ping", scratch / f"log{number}"
            started = child_server(command, url, log=log, cwd=scratch, environment=variables)
            found.append(Server(name, port, stack.enter_context(started)))
        yield found


def load(server: Server, body: bytes, seconds: float) -> tuple[float, float]:
    """Return requests per second, and CPU seconds of the server per request."""
    before_s = server.cpu_s()
    command = [sys.executable, __file__, "--generate", str(server.port), str(seconds)]
    result = json.loads(subprocess.run(command, input=body, stdout=subprocess.PIPE, check=True).stdout)
    return result["answered"] / result["seconds"], (server.cpu_s() - before_s) / result["answered"]


def main() -> None:
    """Print the figures."""
    if sys.argv[1:2] == ["--generate"]:
        generate(int(sys.argv[2]), float(sys.argv[3]))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--estimator", type=Path, default=Path("models/hybrid"))
    parser.add_argument("--before", default="HEAD~1", metavar="COMMIT", help="default: the commit before this one")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each server, request and round")
    options = parser.parse_args()
    requests = bodies(options.estimator)
    example = json.dumps(json.loads(requests[40])["dataframe_split"]).encode()
    with tempfile.TemporaryDirectory() as scratch:
        every, one = os.sched_getaffinity(0), {min(os.sched_getaffinity(0))}
        os.sched_setaffinity(0, one)  # what the servers inherit
        with servers(options.estimator, options.before, example, Path(scratch)) as found:
            os.sched_setaffinity(0, every)
            table(found, requests, options.rounds, options.seconds)


def table(found: list[Server], requests: dict[int, bytes], rounds: int, seconds: float) -> None:
    """Print the load table."""
    print(f"{'rows':>8s}  {'model of':20s}{'requests/s':>12s}{'CPU ms':>10s}{'of ' + found[0].name[:12]:>16s}")
    for rows, body in requests.items():
        figures = [[load(server, body, seconds) for server in found] for _ in range(rounds)]
        for at, server in enumerate(found):
            per_second, cpu_s = (statistics.median(each[at][which] for each in figures) for which in (0, 1))
            ratio = statistics.median(each[at][1] / each[0][1] for each in figures)
            print(f"{rows:8d}  {server.name:20s}{per_second:12.0f}{1e3 * cpu_s:10.2f}{ratio:16.2f}")
    for server in found:
        print(f"{server.name:30s} {server.memory_mb():6.0f} MB in {len(server.tree())} processes")


if __name__ == "__main__":
    main()
