"""Mixed load on ``cylinder-friction serve`` for some minutes: identical bits, flat memory, no server errors.

    python performance/serving_soak.py [--minutes 10] [--run FOLDER]

Clients in a process of their own send, at random but reproducibly, recordings of 1 to 12,000 rows as JSON, CSV and
Arrow, malformed requests, one with a name of 10,000 characters, and bodies that arrive slowly. A quarter into the time
the workers are exchanged (SIGHUP), at half time the champion moves to another version with the same files. Every
response to a body must have the bytes of the first one. Prints what was served, and the memory over time; exits with 1
if a response changed, a status was not the expected one, or memory grew by more than a tenth from the second quarter
to the last.
"""

from __future__ import annotations

import argparse
import http.client
import io
import json
import random
import shutil
import signal
import statistics
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from serving_load import ARROW, CHAMPION, JSON, OURS, arrow, ask, named_rows, running

from cylinder_friction.network.ports import free_port
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.tracking.model_folder import version_of
from cylinder_friction.tracking.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.queues import Queue

CLIENTS = 4
SLOW_S = 2.0
SAMPLED_S = 2.0
GROWTH = 1.1
Request = tuple[str, str, bytes, range, bool]
"""Name, content type, body, expected statuses, and whether the body arrives slowly."""


def requests(run: Path) -> list[Request]:
    """Return the requests to choose from."""
    recording = np.concatenate([each.samples() for each in read_recordings(run / "data/processed/test")])[:12_000]
    good, bad = range(200, 201), range(400, 500)
    found: list[Request] = []
    for rows in (1, 40, 200, 2_000, 12_000):
        part, columns = recording[:rows], list(SAMPLE_COLUMNS)
        split = json.dumps({"dataframe_split": {"columns": columns, "data": part.tolist()}}).encode()
        records = json.dumps({"dataframe_records": [dict(zip(columns, row, strict=True)) for row in part.tolist()]})
        text = io.StringIO()
        np.savetxt(text, part, fmt="%.17g", delimiter=",", header=",".join(columns), comments="")
        found += [
            (f"{rows} rows, dataframe_split", JSON, split, good, False),
            (f"{rows} rows, dataframe_split, slowly", JSON, split, good, True),
            (f"{rows} rows, dataframe_records", JSON, records.encode(), good, False),
            (f"{rows} rows, CSV", "text/csv", text.getvalue().encode(), good, False),
            (f"{rows} rows, Arrow", ARROW, arrow(part), good, False),
        ]
    malformed = [b"", b"null", b"{", b"\xff" * 100_000, b"[" * 100_000, b'{"inputs": {}}', b'{"instances": [[1]]}']
    malformed += [split[: len(split) // 2], split.replace(b"pressure_1_pa", b"pressure_1_bar", 1)]
    found += [(f"malformed {number}", JSON, body, bad, False) for number, body in enumerate(malformed)]
    found += [(f"malformed {ARROW}", ARROW, split, bad, False), ("malformed CSV", "text/csv", b"a,b\n1", bad, False)]
    return [*found, ("a long name", JSON, named_rows(recording, 20_000, "n" * 10_000), good, False)]


def send(port: int, request: Request) -> tuple[int, bytes]:
    """Return status and body of the response."""
    _, content_type, body, _, slowly = request
    if not slowly:
        return ask(port, body, content_type)
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120.0)
    try:
        pieces = [body[place : place + len(body) // 4 + 1] for place in range(0, len(body), len(body) // 4 + 1)]
        headers = {"Content-Type": content_type, "Content-Length": str(len(body))}
        connection.request("POST", "/invocations", _slowly(pieces), headers)
        response = connection.getresponse()
        return response.status, response.read()
    finally:
        connection.close()


def _slowly(pieces: list[bytes]) -> Iterator[bytes]:
    for piece in pieces:
        time.sleep(SLOW_S / len(pieces))
        yield piece


def clients(port: int, run: Path, seconds: float, results: Queue[Any]) -> None:
    """Send requests for some seconds; put their numbers and what went wrong into ``results``."""
    choices, first, wrong = requests(run), dict[str, bytes](), list[str]()
    statuses, ends_s, lock = Counter[int](), time.monotonic() + seconds, threading.Lock()

    def client(seed: int) -> None:
        chance = random.Random(seed)  # noqa: S311
        while time.monotonic() < ends_s:
            request = chance.choice(choices)
            try:
                status, body = send(port, request)
            except OSError as error:
                status, body = 0, repr(error).encode()
            with lock:
                statuses[status] += 1
                if status not in request[3]:
                    wrong.append(f"{request[0]}: status {status}, {body[:200]!r}")
                elif status == 200 and first.setdefault(request[0].removesuffix(", slowly"), body) != body:
                    wrong.append(f"{request[0]}: other bytes than in the first response")

    threads = [threading.Thread(target=client, args=(seed,)) for seed in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    results.put((dict(statuses), wrong))


def move_champion(repository: Path) -> None:
    """Make another version of the champion's files the champion."""
    with open_store(repository) as store:
        before = version_of(store, CHAMPION)
        made = store.client.create_model_version(before.name, str(before.source))
        store.client.set_registered_model_alias(before.name, "champion", made.version)


def main() -> int:
    """Print the figures; return 1 if something went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    options = parser.parse_args()
    run, seconds, port = options.run.resolve(), 60.0 * options.minutes, free_port()
    context, memory_mb = get_context("spawn"), list[float]()
    results = context.Queue()
    with tempfile.TemporaryDirectory() as scratch:
        repository = Path(scratch)
        (repository / ".dvc").mkdir()
        shutil.copy(run / "mlflow.db", repository)
        shutil.copytree(run / "mlartifacts/models", repository / "mlartifacts/models")
        command = [sys.executable, "-m", "cylinder_friction.commands.cli", "serve", CHAMPION, "--port", str(port)]
        with running(OURS, [*command, "--access-log", "access.jsonl"], port, {}, repository) as server:
            load = context.Process(target=clients, args=(port, run, seconds, results))
            load.start()
            began, done = time.monotonic(), set[str]()
            while load.is_alive():
                passed = (time.monotonic() - began) / seconds
                if passed > 0.25 and "exchanged" not in done:
                    server.process.send_signal(signal.SIGHUP)
                    done.add("exchanged")
                if passed > 0.5 and "moved" not in done:
                    move_champion(repository)
                    done.add("moved")
                memory_mb.append(server.memory_mb())
                time.sleep(SAMPLED_S)
            statuses, wrong = results.get()
            load.join()
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz") as response:
                version = json.load(response)["version"]
            log = (repository / f"{port}.log").read_text("utf-8")
            logged = len((repository / "access.jsonl").read_text("utf-8").splitlines())
    print("requests by status: " + ", ".join(f"{status}: {number}" for status, number in sorted(statuses.items())))
    print(f"lines in the access log: {logged}; the champion in service in the end: version {version}")
    quarter = len(memory_mb) // 4
    parts = [statistics.median(memory_mb[place * quarter : (place + 1) * quarter]) for place in range(4)]
    print(
        f"memory: {', '.join(f'{part:.0f}' for part in parts)} MB, medians by quarter; at most {max(memory_mb):.0f} MB"
    )
    print("".join(f"  {each}\n" for each in wrong[:20]) + f"{len(wrong)} wrong")
    print("the server's messages:\n" + "".join(f"  {line}\n" for line in log.splitlines() if "serving" not in line))
    return 1 if wrong or parts[3] > GROWTH * parts[1] else 0


if __name__ == "__main__":
    sys.exit(main())
