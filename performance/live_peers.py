"""The same samples through the live service, MLflow's scoring server, FastAPI and BentoML, per second of a core.

    python performance/live_peers.py [--run FOLDER] [--bentoml /tmp/peer] [--rounds 3] [--seconds 3]

Each server has one worker process on one core, the load comes from the other over kept connections, rounds alternate.
The live service keeps each session's state, bounds and journal, and is sent a window per message, or windows of 25
sessions per message as in ``live_load.py``; the others get the same windows as requests, without state between them:
MLflow's server with the champion, and its exported ONNX graph in a minimal FastAPI application and in BentoML.
``--bentoml`` names a virtual environment of its own, which is made, with pip, if it is not there; without, BentoML is
left out. Prints samples per second, samples per second of the server's processor time (the steadier one on a busy
machine), and by how much the live service has more of these.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from serving_load import CHAMPION, JSON, Server, Work, load, running
from websockets.asyncio.client import ClientConnection, connect

from cylinder_friction.live.frames import EstimateBlock, SampleBlock, pack_samples, unpack
from cylinder_friction.network.ports import free_port
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.tracking.model_folder import artifact_path, download_model, version_of
from cylinder_friction.tracking.store import open_store

CONNECTIONS, AHEAD = 4, 50
BENTO = """
import os

import bentoml
import numpy as np
import onnxruntime


@bentoml.service(workers=1)
class Friction:
    def __init__(self) -> None:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self.session = onnxruntime.InferenceSession(os.environ["GRAPH"], options)
        self.given = {each.name: np.zeros((1, 2)) for each in self.session.get_inputs() if each.name == "offset"}

    @bentoml.api
    def invocations(self, samples: np.ndarray) -> np.ndarray:
        names = ["friction_n", "lower_n", "upper_n", "flags"]
        columns = self.session.run(names, {"samples": samples.astype(np.float64), **self.given})
        return np.stack([column.astype(np.float64) for column in columns], axis=1)
"""


def main() -> None:
    """Print the table."""
    if sys.argv[1:2] == ["--stream"]:
        port, sessions, seconds = sys.argv[2:]
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        window = np.array(json.load(sys.stdin))
        estimates, lasted_s = asyncio.run(stream(int(port), int(sessions), window, float(seconds)))
        sys.stdout.write(json.dumps([estimates, lasted_s]))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    parser.add_argument("--bentoml", type=Path, help="virtual environment for BentoML, made if it is not there")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each server, window and round")
    options = parser.parse_args()
    run = options.run.resolve()
    samples = read_recordings(run / "data/processed/test")[0].samples(SAMPLE_COLUMNS)
    with tempfile.TemporaryDirectory() as scratch, ExitStack() as stack:
        folder = Path(scratch)
        with open_store(run) as store:
            model = download_model(store, version_of(store, CHAMPION), folder / "model")
        live, peers = start(stack, run, model, options.bentoml, folder)
        for rows in (4, 10, 200):
            table(live, peers, samples[:rows], options.rounds, options.seconds)


def start(
    stack: ExitStack, run: Path, model: Path, bentoml: Path | None, folder: Path
) -> tuple[Server, dict[str, Server]]:
    """Return all servers, ready."""
    here, python = str(Path(__file__).parent), sys.executable
    environment = {"GRAPH": str(artifact_path(model, "graph"))}
    ours = [python, "-m", "cylinder_friction.commands.cli", "live", "--model", str(run / "models/hybrid"), "--folder"]
    mlflow = [python, "-m", "mlflow", "models", "serve", "--env-manager", "local", "-w", "1", "-m", str(model), "-p"]
    fastapi = [
        *(python, "-m", "uvicorn", "--app-dir", here, "--factory", "serving_peers:application", "--no-access-log"),
        *("--log-level", "warning", "--port"),
    ]
    commands = {
        "live": ([*ours, str(folder / "live"), "--port"], "/readyz"),
        "mlflow models serve": (mlflow, "/ping"),
        "FastAPI + ONNX": (fastapi, "/ping"),
    }
    if bentoml is not None:
        if not bentoml.exists():
            subprocess.run([python, "-m", "venv", bentoml], check=True)
            subprocess.run([bentoml / "bin/pip", "install", "-q", "bentoml", "onnxruntime"], check=True)
        (folder / "bento.py").write_text(BENTO, "utf-8")
        environment |= {"BENTOML_DO_NOT_TRACK": "true", "BENTOML_HOME": str(folder / "bento")}
        commands["BentoML + ONNX"] = ([str(bentoml / "bin/bentoml"), "serve", "bento:Friction", "--port"], "/readyz")
    found = {}
    for name, (command, ready) in commands.items():
        port = free_port()
        own = environment | ({"PYTHONPATH": ""} if name.startswith("Bento") else {})
        found[name] = stack.enter_context(running(name, [*command, str(port)], port, own, folder, ready))
    return found.pop("live"), found


def table(live: Server, peers: dict[str, Server], window: np.ndarray, rounds: int, seconds: float) -> None:
    """Print the figures of one length of window."""
    rows = len(window)
    figures: dict[str, list[tuple[float, float]]] = {}
    columns = {"columns": list(SAMPLE_COLUMNS), "data": window.tolist()}
    bodies = {name: json.dumps({"dataframe_split": columns}).encode() for name in peers}
    if "BentoML + ONNX" in bodies:
        bodies["BentoML + ONNX"] = json.dumps({"samples": window.tolist()}).encode()
    for _ in range(rounds):
        for sessions in (1, 25):
            name = f"live, {sessions} {'session' if sessions == 1 else 'sessions'} per message"
            figures.setdefault(name, []).append(streamed(live, sessions, window, seconds))
        for name, server in peers.items():
            per_second, cpu_s = load(server, Work(name, rows, JSON, bodies[name]), seconds)
            figures.setdefault(name, []).append((rows * per_second, rows / cpu_s))
    one = figures["live, 1 session per message"]
    print(f"\nwindows of {rows} samples{'samples/s':>25s}{'per CPU second':>18s}{'live, 1, has':>16s}")
    for name, values in figures.items():
        wall, cpu = (statistics.median(column) for column in zip(*values, strict=True))
        ratio = statistics.median(ours[1] / theirs[1] for ours, theirs in zip(one, values, strict=True))
        print(f"  {name:34s}{wall:12,.0f}{cpu:18,.0f}{ratio:14.1f} x", flush=True)


def streamed(live: Server, sessions: int, window: np.ndarray, seconds: float) -> tuple[float, float]:
    """Return estimates per second, and per second of the service's processor time."""
    before_s = live.cpu_s()
    command = [sys.executable, __file__, "--stream", str(live.port), str(sessions), str(seconds)]
    given = json.dumps(window.tolist()).encode()
    estimates, lasted_s = json.loads(subprocess.run(command, input=given, stdout=subprocess.PIPE, check=True).stdout)
    return estimates / lasted_s, estimates / (live.cpu_s() - before_s)


async def stream(port: int, sessions: int, window: np.ndarray, seconds: float) -> tuple[int, float]:
    """Send windows as fast as estimates come back; return how many came, and how long it took."""
    end_s = time.monotonic() + seconds
    sockets = [await connect(f"ws://127.0.0.1:{port}/stream", max_size=None) for _ in range(CONNECTIONS)]
    begin_s = time.monotonic()
    each = (one(socket, place, sessions, window, end_s) for place, socket in enumerate(sockets))
    counts = await asyncio.gather(*each)
    return sum(counts), time.monotonic() - begin_s


async def one(socket: ClientConnection, place: int, sessions: int, window: np.ndarray, end_s: float) -> int:
    """Drive one connection."""
    handles, next_index, rows = [], [], len(window)
    for number in range(sessions):
        opens = {"session": f"{sessions}.{rows} {place}-{number}", "inputs": SAMPLE_COLUMNS, "sample_time_s": 0.005}
        await socket.send(json.dumps({"open": opens}))
        opened = json.loads(await socket.recv())["opened"]
        handles.append(opened["handle"])
        next_index.append(opened["next_index"])
    sent, got, message = 0, 0, 0
    while time.monotonic() < end_s or got < sent:
        while sent - got < AHEAD * rows * sessions and time.monotonic() < end_s:
            base = message * rows
            blocks = (
                SampleBlock(handle, index + base, 1e9 + 0.005 * (index + base), window)
                for handle, index in zip(handles, next_index, strict=True)
            )
            await socket.send(b"".join(map(pack_samples, blocks)))
            sent, message = sent + rows * sessions, message + 1
        for block in unpack(await socket.recv()):  # type: ignore[arg-type]
            got += len(block.flags) if isinstance(block, EstimateBlock) else 0
    await socket.close()
    return got


if __name__ == "__main__":
    main()
