"""A day from the wire to Parquet equals ``cylinder-friction estimate`` on the same logs, bit for bit.

    python performance/live_day.py --model models/hybrid --logs data/raw/rig [--hours 24]

Sends logs through a live service, over and over until the hours are full, each as a recording that begins anew in its
session, as fast as the service takes them; then compares every row of the history with what the command writes. Exits
with 1 unless all are there and equal.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
from live_load import PORT
from live_service import running

from cylinder_friction.commands.estimate import cylinder_of
from cylinder_friction.commands.live import JOURNAL_FILE
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.live.app import HISTORY_FOLDER
from cylinder_friction.live.history import move_into_history
from cylinder_friction.live.journal import Journal
from cylinder_friction.live.replay import PAUSE_S, Replay
from cylinder_friction.recordings.reading_logs import read_logs
from cylinder_friction.recordings.recording import Recording

CLI = (sys.executable, "-m", "cylinder_friction.commands.cli")
COLUMNS = ["friction_n", "lower_n", "upper_n", "flags"]


def main() -> int:
    """Print how many rows there are, and how many differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/hybrid"))
    parser.add_argument("--logs", type=Path, default=Path("data/raw/rig"))
    parser.add_argument("--channels", type=Path, default=Path("conf/ingest/rig.yaml"))
    parser.add_argument("--hours", type=float, default=24.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = ["--channels", str(options.channels), "--model", str(options.model)]
        command = [*CLI, "estimate", str(options.logs), *logs, "--output", str(folder / "friction")]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        sessions = sessions_of(options)
        given = sum(
            len(recording.table) * recording.sample_time_s
            for recordings in sessions.values()
            for recording in recordings
        )
        rounds = -(-int(3600.0 * options.hours) // int(given))
        sent = {session: recordings * rounds for session, recordings in sessions.items()}
        seconds = through_the_service(options.model, folder / "live", sent)
        rows, wrong = compared(folder, sent)
    expected = sum(len(recording.table) for recordings in sent.values() for recording in recordings)
    print(f"{rows / 720_000:.1f} h in {len(sent)} sessions through the service in {seconds:.0f} s")
    print(f"{rows:,} rows in its history of {expected:,} sent; other than `estimate` gives: {wrong:,}")
    return 0 if rows == expected and not wrong else 1


def sessions_of(options: argparse.Namespace) -> dict[str, list[Recording]]:
    """Return the recordings of the logs by session."""
    sessions: dict[str, list[Recording]] = {}
    for recording in read_logs([str(options.logs)], options.channels, cylinder_of(None)):
        sessions.setdefault(recording.metadata.session, []).append(recording)
    return sessions


def through_the_service(model: Path, folder: Path, sent: dict[str, list[Recording]]) -> float:
    """Send all recordings, end the service; return how many seconds it took."""
    settings = {"limits": {"loop_lag_s": 60.0}}  # as fast as it can is late, and all are to come in
    with running(model, folder, PORT, settings) as service:
        begun_s, stop = time.monotonic(), threading.Event()
        threading.Thread(target=report, args=(begun_s, stop), daemon=True).start()
        inputs = load_estimator(model).inputs
        Replay(f"ws://127.0.0.1:{PORT}/stream", sent, None).run(inputs, stop)
        lasted_s = time.monotonic() - begun_s
        stop.set()
        service.terminate()
        service.wait()
    journal = Journal(folder / JOURNAL_FILE)
    move_into_history(journal, folder / HISTORY_FOLDER)  # the rest, which its next start would move
    journal.close()
    return lasted_s


def report(begun_s: float, stop: threading.Event) -> None:
    """Print every ten seconds how far the service is."""
    while not stop.wait(10.0):
        with suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{PORT}/metrics", timeout=60.0) as metrics:
            given = re.search(r"^cylinder_friction_live_estimates_total (\S+)", metrics.read().decode(), re.MULTILINE)
            rows = float(given[1]) if given else 0.0
            print(f"after {time.monotonic() - begun_s:.0f} s: newtons of {rows / 720_000:.1f} h", flush=True)


def compared(folder: Path, sent: dict[str, list[Recording]]) -> tuple[int, int]:
    """Return how many rows of sent recordings the history holds, and how many of them differ."""
    rows = wrong = 0
    for session, recordings in sent.items():
        files = sorted((folder / "live/history" / session).rglob("*.parquet"))
        history = pd.concat([pd.read_parquet(file) for file in files]).set_index("index")
        begin = 0
        for recording in recordings:
            expected = pd.read_parquet(folder / "friction" / f"{recording.name}.parquet")[COLUMNS].to_numpy()
            got = history.loc[begin : begin + len(expected) - 1, COLUMNS].to_numpy()
            rows += len(got)
            wrong += len(expected) if got.shape != expected.shape else int(np.any(got != expected, axis=1).sum())
            begin += len(expected) + round(PAUSE_S / recording.sample_time_s)
    return rows, wrong


if __name__ == "__main__":
    sys.exit(main())
