"""The same work by one process, by two, and by a Dask cluster of two workers on loopback: equal bytes, and how long.

    python performance/execution.py [--parts recordings,search] [--recordings 1000] [--seconds 4]
                                    [--trials 16] [--batch 4]

Records a campaign on the simulated rig and cuts it into short recordings, which go through ingest, filter and label,
each stage in a process of its own with one thread; then the first trials of the default recipe's search (which has
16), four at a time. Each part is done five times, on two idle cores in about 3 minutes for the recordings and 8 for
the search. On the cluster all of it is done once more while a worker is killed (SIGKILL), and once more after the
command itself was killed. Times are seconds of the clock, imports and the start of processes
in them, and stand beside those of the one process in the same run as ratios. Exits with 1 unless every way gave the
same bytes.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from loopback_cluster import SOURCE, loopback_cluster

from cylinder_friction.execution.workers import ONE_THREAD, VARIABLE
from cylinder_friction.recordings.files import hash_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

CLI = (sys.executable, "-m", "cylinder_friction.commands.cli")
RECORDINGS, SEARCH = ("ingest", "filter", "label"), ("search",)
PARTS = ("recordings", "search")
WRITTEN = {
    "ingest": "data/interim/recordings",
    "filter": "data/interim/signals",
    "label": "data/processed",
    "search": "models/search",
}
DRAFTS = {"filter": "data/interim/.signals.draft", "label": "data/processed/.labelled.draft"}
SHORT, NO_TRUTH = "ingest.checks.minimum_duration_s=2", "ingest.truth=data/raw/no_truth"
LOG = "stage.log"
FIRST_RECORDINGS = 12  # Of the smoke recipe


def main() -> int:
    """Print the tables; return 1 unless all bytes are equal."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", default=",".join(PARTS), help="some of them, with commas between")
    parser.add_argument("--recordings", type=int, default=1000)
    parser.add_argument("--seconds", type=int, default=4, help="of each recording")
    parser.add_argument("--trials", type=int, default=16)
    parser.add_argument("--batch", type=int, default=4)
    options = parser.parse_args()
    parts = options.parts.split(",")
    if not set(parts) <= set(PARTS):
        parser.error(f"--parts is {options.parts}; expected some of {','.join(PARTS)}")
    equal = True
    with tempfile.TemporaryDirectory() as name:
        for part in parts:
            folder = Path(name) / part
            shutil.copytree(SOURCE.parent / "conf", folder / "conf")
            if part == "recordings":
                duration_s = -(-options.recordings // FIRST_RECORDINGS) * options.seconds
                call(folder, *CLI, "params", "experiment=smoke", NO_TRUTH, SHORT, f"record.duration_s={duration_s}")
                call(folder, *CLI, "stage", "record")
                cut(folder / "data/raw/rig", options.recordings, options.seconds)
                equal &= compared(folder, RECORDINGS, f"{options.recordings} recordings of {options.seconds} s")
            else:
                call(folder, *CLI, "params", f"search.trials={options.trials}", f"search.batch={options.batch}")
                for stage in ("record", *RECORDINGS, "split", "offset"):
                    call(folder, *CLI, "stage", stage)
                equal &= compared(folder, SEARCH, f"{options.trials} trials in batches of {options.batch}")
    return 0 if equal else 1


def cut(raw: Path, count: int, seconds: int) -> None:
    """Cut logs into so many short ones, of the same sessions."""
    made = 0
    for path in sorted(raw.glob("*.csv")):
        head, *lines = path.read_text(encoding="utf-8").splitlines()
        path.unlink()
        rows = 200 * seconds
        for begin in range(0, len(lines) - rows + 1, rows):
            if made < count:
                text = "\n".join([head, *lines[begin : begin + rows], ""])
                path.with_name(f"{path.stem}_{begin // rows:04d}.csv").write_text(text, encoding="utf-8")
                made += 1


def compared(folder: Path, stages: Sequence[str], what: str) -> bool:
    """Print how long the stages take each way; return whether they wrote the same bytes."""
    print(f"\n{what}: seconds (as a share of one process)\n{'':34}" + "".join(f"{stage:>16}" for stage in stages))
    alone = way("one process", folder, stages, {})
    found = [way("two processes", folder, stages, {VARIABLE: "2"}, alone)]
    with tempfile.TemporaryDirectory() as place, loopback_cluster(Path(place)) as cluster:
        given = {VARIABLE: cluster.address}
        found += [
            way("Dask, two workers", folder, stages, given, alone),
            way("Dask, a worker killed", folder, stages, given, alone, lambda _: cluster.kill_worker()),
            way("Dask, command killed and repeated", folder, stages, given, alone, kill_command),
        ]
    equal = all(hashes == alone[1] for _, hashes in found)
    print("all bytes are equal" if equal else f"BYTES DIFFER: {[alone[1], *(hashes for _, hashes in found)]}")
    return equal


def way(
    name: str,
    folder: Path,
    stages: Sequence[str],
    given: dict[str, str],
    alone: tuple[dict[str, float], dict[str, str]] | None = None,
    disturb: Callable[[subprocess.Popen[bytes]], None] | None = None,
) -> tuple[dict[str, float], dict[str, str]]:
    """Print seconds by stage, and return them with the hash of what each wrote; ``disturb`` gets the last stage."""
    for place in (*(WRITTEN[stage] for stage in stages), ".cylinder-friction"):
        shutil.rmtree(folder / place, ignore_errors=True) if place != "data/processed" or "label" in stages else None
    seconds = {}
    for stage in stages:
        started_s = time.monotonic()
        command = started(folder, stage, given)
        if disturb is not None and stage == stages[-1]:
            while not half_done(folder, stage) and command.poll() is None:
                time.sleep(0.02)
            disturb(command)
        if command.wait() and disturb is kill_command:
            command = started(folder, stage, given)
        if command.wait():
            sys.exit(f"{name}: {stage} failed: {(folder / LOG).read_text(encoding='utf-8')[-2000:]}")
        seconds[stage] = time.monotonic() - started_s
    shares = {stage: each / alone[0][stage] if alone else 1.0 for stage, each in seconds.items()}
    print(f"{name:34}" + "".join(f"{each:9.1f} ({shares[stage]:4.2f})" for stage, each in seconds.items()), flush=True)
    return seconds, {stage: hash_of(folder / WRITTEN[stage]) for stage in stages}


def half_done(folder: Path, stage: str) -> bool:
    """Return whether some of a stage's pieces are done, and not all."""
    if stage == "search":
        return any(path.read_bytes().count(b"\n") > 2 for path in folder.glob(".cylinder-friction/resume/*/trials.log"))
    return sum(1 for _ in (folder / DRAFTS[stage]).glob("*/*.parquet")) > 5


def kill_command(command: subprocess.Popen[bytes]) -> None:
    """Kill the command, and the processes below it."""
    command.kill()
    command.wait()


def call(folder: Path, *command: str) -> None:
    """Run commands in a folder, quietly, or exit."""
    done = subprocess.run(command, cwd=folder, env=environment({}), capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)


def started(folder: Path, stage: str, given: dict[str, str]) -> subprocess.Popen[bytes]:
    """Start a stage that writes what it prints into a file."""
    with (folder / LOG).open("wb") as log:
        return subprocess.Popen((*CLI, "stage", stage), cwd=folder, env=environment(given), stdout=log, stderr=log)


def environment(given: dict[str, str]) -> dict[str, str]:
    """Return the environment of a command: one thread, no workers but those given, no MLflow server."""
    own = {name: value for name, value in os.environ.items() if name != VARIABLE}
    store = {"MLFLOW_TRACKING_URI": "sqlite:///mlflow.db", "PYTHONPATH": str(SOURCE)}
    return {**own, **dict.fromkeys(ONE_THREAD, "1"), **store, **given}


if __name__ == "__main__":
    sys.exit(main())
