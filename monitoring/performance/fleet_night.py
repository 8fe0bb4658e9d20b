"""The nightly run over a large fleet: ``python monitoring/performance/fleet_night.py --cylinders 200 --sessions 365``.

Some sessions of one cylinder are simulated and processed. Copies of its results, under other names, dates and hashes,
fill up its life and the other cylinders', so that a night finds what it would find after a year. Then each cylinder
gets one new log: the same session with other pressures in the last digits. Each run of `monitor` is a process of its
own, on one core.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, replace
from datetime import datetime, timedelta
from pathlib import Path

import pandas as pd
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.results import Result, read_results
from cylinder_friction.files.whole_files import read_json, write_json
from cylinder_friction.recordings.storage import read_recording, write_recording
from cylinder_friction_monitoring.fleet.demonstration import CHANNELS, DIMENSIONS
from cylinder_friction_monitoring.fleet.files import RESULTS, session_file
from cylinder_friction_monitoring.fleet.fleet_file import load_fleet
from cylinder_friction_monitoring.fleet.nightly import code_hash
from cylinder_friction_monitoring.fleet.one_cylinder import CylinderRun
from cylinder_friction_monitoring.fleet.processes import ONE_THREAD
from cylinder_friction_monitoring.fleet.sessions import KeptRow, key_of, read_rows, write_rows
from cylinder_friction_monitoring.lives import LifePlan, life

FIRST, SIMULATED = "first", 40
DAY = datetime(2025, 1, 1, 6)


def write_logs(folder: Path) -> pd.DataFrame:
    """Write one cylinder's logs, a day each, and return the table of one more."""
    recordings = life(Cylinder(name=FIRST, **DIMENSIONS), LifePlan(sessions=SIMULATED + 1), 0)
    for number, each in enumerate(recordings):
        if number == SIMULATED:
            return each.logger
        write_log(folder / f"{day(number)}.csv", each.logger, 0)
    raise AssertionError("a life is as long as its plan")


def write_log(path: Path, table: pd.DataFrame, variant: int) -> None:
    """Write a log; each variant has other pressures, by 0.01 % of them."""
    pressures = {name: table[name] * (1.0 + 1e-4 * variant) for name in ("P1 [bar]", "P2 [bar]")}
    path.parent.mkdir(parents=True, exist_ok=True)
    table.assign(**pressures).to_csv(path, index=False, float_format="%.3f")
    os.utime(path, (1e9, 1e9))


def day(number: int) -> str:
    return f"{DAY + timedelta(days=number):%Y-%m-%dT%H}"


def write_fleet(folder: Path, names: list[str]) -> None:
    defaults = {"dimensions": DIMENSIONS, "channels": "channels.yaml"}
    (folder / "channels.yaml").write_text(yaml.safe_dump(CHANNELS, sort_keys=False))
    content = {"defaults": defaults, "cylinders": {name: {} for name in names}}
    (folder / "fleet.yaml").write_text(yaml.safe_dump(content))


def copy_results(
    health: Path, name: str, sessions: int, results: list[Result], rows: dict[str, KeptRow], made_by: str
) -> None:
    """Give a cylinder a life of results of the first one, under its own name, dates and hashes."""
    own, base = health / RESULTS / name, health / RESULTS / FIRST
    made_with = hashlib.sha256(repr(Cylinder(name=name, **DIMENSIONS)).encode()).hexdigest()
    own.mkdir(parents=True)
    about, kept = [], {}
    for number in range(sessions):
        each = results[number % len(results)]
        before = rows[each.entry.session].row
        new, digest = f"{name}-{day(number)}", hashlib.sha256(f"{name}{number}".encode()).hexdigest()
        start = f"{DAY + timedelta(days=number):%Y-%m-%dT%H:%M:%S}Z"
        file = f"{name}/{day(number)}.csv"
        entry = replace(each.entry, source_sha256=digest, name=new, session=new, source_file=file, start=start)
        depends_on = {**each.depends_on, "cylinder": made_with}
        texts = replace(each, entry=entry, depends_on=depends_on, beside=()).texts()
        write_recording(own, read_recording(base / each.file), new, texts)
        about.append(asdict(entry))
        row = replace(before, cylinder=name, session=new, start=start)
        kept[new] = KeptRow(row, key_of([asdict(entry)], made_by))
    summary = read_json(base / "summary.json")
    files = [f"{each['name']}.parquet" for each in about] + ["summary.json"]
    write_json(own / "summary.json", summary | {"recordings": about, "files": sorted(files), "depends_on": depends_on})
    write_rows(health / session_file(name), [each.row for each in kept.values()], kept, {}, {})


def night(folder: Path, *more: str) -> str:
    """Run `monitor` in a process and return what it took; 3 is the status of a night with alarms."""
    paths = ["--fleet", str(folder / "fleet.yaml"), "--into", str(folder / "health")]
    command = [sys.executable, "-m", "cylinder_friction.commands.cli", "monitor", *more, "--workers", "1", *paths]
    started = time.monotonic()
    child = subprocess.Popen(command, env={**os.environ, **dict.fromkeys(ONE_THREAD, "1")}, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode not in (0, 3):
        raise RuntimeError(f"{command} failed with status {child.returncode}")
    cpu_s, clock_s = used.ru_utime + used.ru_stime, time.monotonic() - started
    return f"{cpu_s:.1f} s of CPU, {clock_s:.1f} s by the clock, at most {used.ru_maxrss / 1024.0:.0f} MB"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cylinders", type=int, default=200)
    parser.add_argument("--sessions", type=int, default=365)
    parser.add_argument("--new", type=int, help="cylinders with a new log; default: all")
    options = parser.parse_args()
    names = [f"c{number:05d}" for number in range(options.cylinders)]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        last = write_logs(folder / "logs" / FIRST)
        write_fleet(folder, [FIRST])
        print("the first cylinder:", night(folder, str(folder / "logs")), flush=True)
        health = folder / "health"
        owned, code = load_fleet(folder / "fleet.yaml").cylinders[FIRST], code_hash()
        made_by = CylinderRun(FIRST, owned, health, folder, code, DAY).made_by
        results, rows = read_results(health / RESULTS / FIRST), read_rows(health / session_file(FIRST))
        shutil.rmtree(folder / "logs")
        for name in names:
            copy_results(health, name, options.sessions, results, rows, made_by)
        marker = read_json(health / "health.json")
        tables = [session_file(name) for name in names]
        write_json(health / "health.json", marker | {"files": sorted({*marker["files"], *tables})})
        write_fleet(folder, names)
        print("all assessed for the first time:", night(folder), flush=True)
        for number, name in enumerate(names[: options.new]):
            write_log(folder / "logs" / name / f"{day(options.sessions)}.csv", last, number % 1000)
        print(f"a night with {options.new or len(names)} new logs:", night(folder, str(folder / "logs")), flush=True)
        print("a night with nothing new:", night(folder, str(folder / "logs")), flush=True)
        sizes = {name: (health / name).stat().st_size for name in ("health.html", "health.json", "health.sqlite")}
        panes = [path.stat().st_size for path in (health / "panes").iterdir()]
        print("bytes:", sizes, "largest pane", max(panes))


if __name__ == "__main__":
    main()
