"""A hundred hours of recordings through ingest, filter and label, beside the same work in plain pandas.

    python performance/ingest_throughput.py [--hours 100] [--folder FOLDER] [Hydra overrides ...]

Writes recordings of ten minutes at 200 Hz as a logger would (Parquet, bar and millimetres), then runs each stage on
one core in a process of its own, so that the peak of memory is that stage's. ``plain_pandas.py`` is run the same way.

Rows per second are rows over seconds of CPU, the program's and the kernel's, from the start of the process to its end:
imports and the hashes of what is read and written are in it. What numba compiles was compiled before, as it is after
the first run on a computer. A hundred hours take about 8 GB of disk, as only one side's files lie there at a time.

The kernel's share is mostly the page cache that written files fill. In a virtual machine that gives idle memory back
to its host, each page that it takes anew costs ten times as much as on a machine of one's own.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

HERE = Path(__file__).resolve()
CONF = HERE.parents[1] / "conf"
STAGES = ("ingest", "filter", "label")
SIDES = ("stages", "pandas")
LOGS = Path("data/raw/logs")
PANDAS_FOLDER = Path("data/pandas")
OVERRIDES = (
    f"ingest.source={LOGS.as_posix()}",
    "ingest.truth=data/raw/no_truth",
    "ingest.pattern='*.parquet'",
    "~ingest.channels.oil_temperature_c",
    "ingest.name_pattern='(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_'",
    "split.test_sessions=1",
    "split.validation_sessions=1",
)
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "ARROW_IO_THREADS")
WARM_UP_HOURS, WARM_UP_MINUTES = 0.05, 1.0
LEAST_ROWS_PER_SECOND, MOST_MB = 2e6, 1500.0


@dataclass(frozen=True)
class Cost:
    """Of one process: seconds of CPU, of them the kernel's and those for imports; seconds of the clock; peak memory."""

    cpu_s: float
    kernel_s: float
    import_s: float
    wall_s: float
    peak_mb: float


def main() -> int:
    """Print the table; returns 1 if the stages miss their goals."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=100.0, help="recorded time in all")
    parser.add_argument("--minutes", type=float, default=10.0, help="length of one recording")
    parser.add_argument("--folder", type=Path, help="where to put a folder to work in; it is removed at the end")
    parser.add_argument("--work", nargs=2, help=argparse.SUPPRESS)  # what the processes measured are called with
    parser.add_argument("overrides", nargs="*", help="Hydra overrides of conf/")
    arguments = parser.parse_args()
    if arguments.work:
        return work(*arguments.work)
    if arguments.folder:
        arguments.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="throughput-", dir=arguments.folder) as name:
        small, whole = Path(name) / "warm-up", Path(name) / "logs"
        for folder, hours, minutes in (
            (small, WARM_UP_HOURS, WARM_UP_MINUTES),
            (whole, arguments.hours, arguments.minutes),
        ):
            folder.mkdir()
            job = json.dumps({"hours": hours, "minutes": minutes, "overrides": [*OVERRIDES, *arguments.overrides]})
            (folder / "job.json").write_text(job, encoding="utf-8")
            run(folder, "stages", "prepare")
        for side in SIDES:
            measure(small, side)
        costs, sizes = {}, {}
        for side in SIDES:
            costs[side] = measure(whole, side)
            sizes[side] = sum(megabytes(whole / folder) for folder in written_by(side))
            set_one_aside(whole, side)
        rows, friction_n = int((whole / "rows").read_text()), friction_of_one(whole)
        logs_mb = megabytes(whole / LOGS)
    sys.stdout.write(table(rows, costs))
    sys.stdout.write(
        f"\n{rows / 1e6:.2f} million rows in {logs_mb:.0f} MB of logs; written: {sizes['stages']:.0f} MB by the "
        f"stages, {sizes['pandas']:.0f} MB by pandas\nfriction of one recording: mean magnitude {friction_n[0]:.1f} N, "
        f"largest difference between the two {friction_n[1]:.2g} N\n"
    )
    return 0 if goals_met(rows, costs["stages"]) else 1


def measure(folder: Path, side: str) -> dict[str, Cost]:
    """Run the three stages one after another, each in its own process."""
    return {stage: run(folder, side, stage) for stage in STAGES}


def run(folder: Path, side: str, stage: str) -> Cost:
    """Run one stage in a process of its own and returns what it took.

    Raises:
        RuntimeError: It failed; the message is its output.
    """
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1")}
    command = [sys.executable, str(HERE), "--work", side, stage]
    with (folder / "log.txt").open("w+", encoding="utf-8") as log:
        began = time.perf_counter()
        child = subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(child.pid, 0)
        wall_s = time.perf_counter() - began
        child.returncode = os.waitstatus_to_exitcode(status)
        log.seek(0)
        lines = log.read().splitlines()
    if child.returncode:
        raise RuntimeError(f"{side} {stage} failed:\n" + "\n".join(lines))
    report = json.loads(lines[-1])
    return Cost(used.ru_utime + used.ru_stime, used.ru_stime, report["import_s"], wall_s, report["peak_mb"])


def work(side: str, stage: str) -> int:
    """Do one stage in the current folder, on one core; report its peak of memory and the time of its imports."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    begin = prepare() if stage == "prepare" else (stage_of_project if side == "stages" else stage_of_pandas)(stage)
    import_s = time.process_time()
    begin()
    sys.stdout.write(f"\n{json.dumps({'import_s': import_s, 'peak_mb': peak_mb()})}\n")
    return 0


def prepare() -> Callable[[], object]:
    """Return what writes the logs and params.yaml."""
    from logged_hours import write_logs

    from cylinder_friction.commands.params import write_params
    from cylinder_friction.params.checking import load_params
    from cylinder_friction.stages._stage import cylinder_from

    def begin() -> None:
        job = json.loads(Path("job.json").read_text(encoding="utf-8"))
        write_params(CONF, job["overrides"])
        rows = write_logs(LOGS, job["hours"], job["minutes"], cylinder_from(load_params().cylinder))
        Path("rows").write_text(str(rows))

    return begin


def stage_of_project(stage: str) -> Callable[[], object]:
    """Return a function that runs one stage as the pipeline does, except tracking."""
    import importlib

    from cylinder_friction.params.checking import load_params

    module = importlib.import_module(f"cylinder_friction.stages.{stage}")
    return lambda: module.run(load_params())


def stage_of_pandas(stage: str) -> Callable[[], object]:
    """Return what does the same in pandas."""
    import plain_pandas

    from cylinder_friction.cylinder import Cylinder

    cylinder = Cylinder(
        name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
    )
    recordings, signals, labelled = written_by("pandas")
    return {
        "ingest": lambda: plain_pandas.ingest(LOGS, recordings, cylinder),
        "filter": lambda: plain_pandas.smooth(recordings, signals),
        "label": lambda: plain_pandas.label(signals, labelled, cylinder),
    }[stage]


def written_by(side: str) -> tuple[Path, Path, Path]:
    """Return where the three stages write."""
    if side == "pandas":
        return PANDAS_FOLDER / "recordings", PANDAS_FOLDER / "signals", PANDAS_FOLDER / "processed"
    return Path("data/interim/recordings"), Path("data/interim/signals"), Path("data/processed")


def peak_mb() -> float:
    """Return the largest resident memory of this process so far; what its parent had before does not count."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return float(status.split("VmHWM:")[1].split()[0]) / 1024.0


def megabytes(folder: Path) -> float:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def set_one_aside(folder: Path, side: str) -> None:
    """Keep the first labelled recording and removes all else that this side wrote."""
    first = min((folder / written_by(side)[2]).rglob("condition*.parquet"), key=lambda path: path.name)
    first.rename(folder / f"{side}.parquet")
    for written in written_by(side):
        shutil.rmtree(folder / written)


def friction_of_one(folder: Path) -> tuple[float, float]:
    """Return mean |friction| of the recording set aside and the largest difference between the two sides [N]."""
    import pandas as pd

    own, plain = (pd.read_parquet(folder / f"{side}.parquet")["friction_n"] for side in SIDES)
    return float(own.abs().mean()), float((own - plain).abs().max())


def table(rows: int, costs: dict[str, dict[str, Cost]]) -> str:
    """Return the table, the ratios in front."""
    heads = ("rows/s", "CPU s", "kernel", "imports", "clock s", "MB")
    half = f"{heads[0]:>10}" + "".join(f"{head:>9}" for head in heads[1:])
    lines = [
        f"{'':8}{'pandas : stages':>18}{'stages, one core':>{len(half)}}{'pandas, one core':>{len(half)}}",
        f"{'':8}{'CPU':>9}{'memory':>9}{half}{half}",
    ]
    for stage in (*STAGES, "all"):
        own, plain = (total(costs[side]) if stage == "all" else costs[side][stage] for side in SIDES)
        line = f"{stage:8}{plain.cpu_s / own.cpu_s:>9.2f}{plain.peak_mb / own.peak_mb:>9.2f}"
        for cost in (own, plain):
            line += f"{rows / cost.cpu_s / 1e6:>8.2f} M{cost.cpu_s:>9.1f}{cost.kernel_s:>9.1f}{cost.import_s:>9.1f}"
            line += f"{cost.wall_s:>9.1f}{cost.peak_mb:>9.0f}"
        lines.append(line)
    goal = f"goal: {LEAST_ROWS_PER_SECOND / 1e6:.0f} M rows per second of CPU through all three, below {MOST_MB:.0f} MB"
    return "\n".join([*lines, f"{goal}: {'met' if goals_met(rows, costs['stages']) else 'MISSED'}", ""])


def total(costs: dict[str, Cost]) -> Cost:
    """Return the sum of three stages, and the largest of their peaks."""
    sums = {name: sum(getattr(cost, name) for cost in costs.values()) for name in vars(costs[STAGES[0]])}
    return Cost(**sums | {"peak_mb": max(cost.peak_mb for cost in costs.values())})


def goals_met(rows: int, costs: dict[str, Cost]) -> bool:
    whole = total(costs)
    return rows / whole.cpu_s >= LEAST_ROWS_PER_SECOND and whole.peak_mb < MOST_MB


if __name__ == "__main__":
    sys.exit(main())
