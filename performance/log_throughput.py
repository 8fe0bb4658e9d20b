"""The command ``estimate`` on logger files of every size, beside a script as a user would write it for the same files.

    python performance/log_throughput.py [--gigabytes 2] [--logs data/raw/rig] [--model models/hybrid] [--folder FOLDER]
        [--only "200 files" ...]

One file, 200 files of 12,000 rows, 600 and 1,000 of 2,400, and one large one at two sizes, made of the rig's
recordings, as CSV.
The script (``PEER``) reads each with pandas, smooths with SciPy, computes the force balance and its medians, and writes
Parquet and a summary; it draws nothing. The sides named `bare` are ``estimate`` without checks, bounds, offsets, levels
and figures (``BARE``): the least that it could take. Every run is a process of its own, on one core but for the sides
named `cores`: rows per second are rows over its seconds of CPU, imports included; memory is its peak. Ratios are those
of CPU time, time on the clock and memory to the script. Of many files it prints the clock on all cores over the CPU
time, the time of a second run with nothing new and of one with ten new files, and the size of the page; before all,
that of `--help` beside the import of NumPy.
The two large files show whether memory grows with the file; the larger one's time and memory are extrapolated to ten
times its size. Large files are removed at the end; needs a finished `dvc repro`, or `--no-model` and the rig's logs.
"""

from __future__ import annotations

import argparse
import compileall
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv
from service_process import CLI

import cylinder_friction

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
TIME, PRESSURES = "Time [s]", ["P1 [bar]", "P2 [bar]"]
RATE_HZ, NOISE_BAR = 200.0, 0.05
MANY = {"200 files": (200, 12_000), "600 files": (600, 2_400), "1,000 files": (1_000, 2_400)}
"""Number of files, and rows of each."""
NAMES = r"(?P<session>(?P<condition>[a-z]+)[0-9]*)"
PEER = """
import json, pathlib, sys
import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

BORE, ROD, MASS, RATE = 0.063, 0.028, 6.0, 200.0
A1 = np.pi / 4 * BORE**2
A2 = A1 - np.pi / 4 * ROD**2
logs, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
out.mkdir(exist_ok=True)
summary = []
for path in sorted(logs.glob("*.csv")):
    log = pd.read_csv(path)
    t, p1, p2, x = (log[name].to_numpy() for name in ("Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]"))
    p1, p2, x = p1 * 1e5, p2 * 1e5, x * 1e-3
    v = savgol_filter(x, 21, 3, deriv=1, delta=1 / RATE)
    a = savgol_filter(x, 31, 3, deriv=2, delta=1 / RATE)
    friction = savgol_filter(p1, 11, 2) * A1 - savgol_filter(p2, 11, 2) * A2 - MASS * a
    usable = (x > 0.003) & (x < 0.247)
    usable[:20] = usable[-20:] = False
    moving = usable & (np.abs(v) > 6e-3)
    out_n, back_n = friction[moving & (v > 0)], friction[moving & (v < 0)]
    result = pd.DataFrame({"time_s": t, "pressure_1_pa": p1, "pressure_2_pa": p2, "position_m": x, "velocity_m_s": v})
    result = result.assign(friction_n=friction, usable=usable)
    result.to_parquet(out / f"{path.stem}.parquet")
    half = 0.5 * (np.median(out_n) - np.median(back_n)) if len(out_n) and len(back_n) else None
    summary.append({"name": path.stem, "rows": len(log), "friction_n": half, "usable": float(usable.mean())})
(out / "friction.html").write_text(pd.DataFrame(summary).to_html())
(out / "summary.json").write_text(json.dumps(summary, default=float))
"""
"""What ``estimate`` is compared with: friction of each file, without checks, bounds, offsets, figures or repairs."""
BARE = """
import sys
from cylinder_friction.commands.cli import main
from cylinder_friction.estimation import friction_of_logs, from_logs
from cylinder_friction.labelling import label
from cylinder_friction.recordings import conversion
from cylinder_friction.recordings.checks import recording_checks

recording_checks.inspect_recording = lambda *_: iter(())
conversion.screen_signals = lambda signals, *_: (dict(signals), ())
label.smoothing_deviation = label.inertia_deviation = lambda *_: 0.0
label.label_uncertainty = friction_of_logs.offset_evidence = lambda *_: None
friction_of_logs.friction_levels, friction_of_logs.missing_mass = lambda _: (), lambda *_: ""
friction_of_logs.RecordingFriction.finished = lambda _, recording, *__: (
    recording.with_columns(**{"lower_n": recording.column("friction_n"), **recording.columns})
)
from_logs.friction_pane = lambda *_: "nothing"
sys.exit(main())
"""
"""``estimate`` with all that the script does not do replaced by nothing: what is left is its least cost."""
NEW_FILES = 10
FLAT = 1.05
"""Memory is flat if it grows by no more than this from a quarter of the file to the whole."""


@dataclass(frozen=True)
class Cost:
    """Of one process."""

    cpu_s: float
    clock_s: float
    peak_mb: float


def main() -> int:
    """Print the table; returns 1 if memory grows with the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gigabytes", type=float, default=2.0, help="of the large file")
    parser.add_argument("--logs", type=Path, default=Path("data/raw/rig"), help="folder of the rig's recordings")
    parser.add_argument("--model", type=Path, default=Path("models/hybrid"))
    parser.add_argument("--no-model", action="store_true", help="leave the model out")
    parser.add_argument("--no-large", action="store_true", help="leave the large files out")
    parser.add_argument("--only", nargs="+", help="cases to run; default: all")
    parser.add_argument("--folder", type=Path, help="where to put a folder to work in; it is removed at the end")
    arguments = parser.parse_args()
    recordings = [pd.read_csv(path) for path in sorted(arguments.logs.glob("*.csv"))]
    sizes = {"a quarter": 0.25e9 * arguments.gigabytes, "large": 1e9 * arguments.gigabytes}
    sizes = {} if arguments.no_large else sizes
    compileall.compile_dir(Path(cylinder_friction.__file__).parent, quiet=1)  # as pip does, and has done for pandas
    numpy = timed([sys.executable, "-c", "import numpy"])
    for given in (["--help"], ["--version"], ["estimate", "--mistyped"]):
        beside = timed([*CLI, *given], 2).cpu_s / numpy.cpu_s
        sys.stdout.write(f"{' '.join(given)}: {beside:.2f} of the CPU time of `import numpy`\n")
    columns = f"{'rows/s':>12}{'CPU':>7}{'clock':>7}{'MB':>8}{'memory':>8}"
    sys.stdout.write(f"{'':16}{'rows':>12}{'MB':>8}  {'':14}{columns}\n")
    peaks: dict[tuple[str, str], Cost] = {}
    with tempfile.TemporaryDirectory(prefix="log-throughput-", dir=arguments.folder) as name:
        work = Path(name)
        for case in arguments.only or ("one file", *MANY, *sizes):
            folder = work / "logs"
            folder.mkdir()
            rows = written(case, folder, recordings, sizes)
            size_mb = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
            script = peaks[case, "script"] = cost("script", folder, work / "out", arguments.model)
            sys.stdout.write(line(case, rows, size_mb, "script", script, script))
            many = case in MANY
            sides = [
                f"{side}{of}"
                for side in ("label", *([] if arguments.no_model else ["model"]))
                for of in ("", *([", bare", ", cores"] if many else []))
            ]
            for side in sides:
                shutil.rmtree(work / "out", ignore_errors=True)
                peaks[case, side] = cost(side, folder, work / "out", arguments.model)
                sys.stdout.write(line(case, rows, size_mb, side, peaks[case, side], script))
            if many:
                on_cores = peaks[case, "label, cores"]
                sys.stdout.write(f"on all cores: clock {on_cores.clock_s / on_cores.cpu_s:.2f} of the CPU time\n")
                again(folder, work, arguments.model, script)
            shutil.rmtree(folder)
            shutil.rmtree(work / "out")
    flat = True
    for side in ("script", "label", *([] if arguments.no_model else ["model"])) if ("large", "label") in peaks else ():
        small, large = peaks["a quarter", side], peaks["large", side]
        grows = large.peak_mb / small.peak_mb
        flat &= side == "script" or grows <= FLAT
        mb = large.peak_mb + 12.0 * (large.peak_mb - small.peak_mb) if grows > FLAT else large.peak_mb
        sys.stdout.write(
            f"{side}: memory of the large file over that of a quarter {grows:.2f}; a file of "
            f"{10.0 * arguments.gigabytes:.0f} GB takes about {10.0 * large.cpu_s / 60.0:.0f} min and {mb:.0f} MB\n"
        )
    return 0 if flat else 1


def written(case: str, folder: Path, recordings: list[pd.DataFrame], sizes: dict[str, float]) -> int:
    """Write the files of a case and return how many rows they hold."""
    if case == "one file":
        recordings[0].to_csv(folder / "one1.csv", index=False)
        return len(recordings[0])
    if case not in sizes:
        count, rows = MANY[case]
        long = pd.concat(map(glided, recordings, [*recordings[1:], recordings[0]]), ignore_index=True)
        for number in range(count):
            first = number * rows % (len(long) - rows)
            seen = long.iloc[first : first + rows].copy()
            seen[TIME] = np.round(np.arange(rows) / RATE_HZ, 3)
            noise_bar = np.random.default_rng(number).normal(0.0, NOISE_BAR, (len(seen), 2))  # no two are alike
            seen[PRESSURES] = (seen[PRESSURES] + noise_bar).clip(lower=0.0).round(3)
            seen.to_csv(folder / f"small{number:04d}.csv", index=False)
        return count * rows
    joined = map(glided, recordings, [*recordings[1:], recordings[0]])
    table = pa.Table.from_pandas(pd.concat(joined), preserve_index=False)
    rows, path = 0, folder / "large1.csv"
    path.touch()
    while path.stat().st_size < sizes[case]:
        stamps = pa.array(np.round((rows + np.arange(len(table))) / RATE_HZ, 3))
        options = pa_csv.WriteOptions(include_header=rows == 0, quoting_style="none")
        with path.open("ab") as file:
            pa_csv.write_csv(table.set_column(0, TIME, stamps), file, options)
        rows += len(table)
    return rows


def glided(recording: pd.DataFrame, following: pd.DataFrame) -> pd.DataFrame:
    """Return a recording that ends where the next one begins, a second later: a position that jumps is a fault."""
    share = np.linspace(0.0, 1.0, round(RATE_HZ))[1:-1, None]
    first, last = recording.iloc[-1].to_numpy(), following.iloc[0].to_numpy()
    between = pd.DataFrame((first + share * (last - first)).round(3), columns=recording.columns)
    return pd.concat([recording, between])


def again(folder: Path, work: Path, model: Path, script: Cost) -> None:
    """Print what further runs over the same files cost, and the size of the page."""
    later = sorted(folder.iterdir())[:NEW_FILES]
    (work / "later").mkdir(exist_ok=True)
    for path in later:
        path.rename(work / "later" / path.name)
    shutil.rmtree(work / "out")
    cost("label", folder, work / "out", model)
    nothing = cost("label", folder, work / "out", model)
    for path in later:
        (work / "later" / path.name).rename(path)
    ten = cost("label", folder, work / "out", model)
    for words, each in (("nothing new", nothing), (f"{NEW_FILES} new files", ten)):
        sys.stdout.write(f"{words}: {each.clock_s:.1f} s, {each.clock_s / script.clock_s:.2f} of the script's time\n")
    sys.stdout.write(f"page: {(work / 'out/friction.html').stat().st_size / 1e6:.2f} MB\n")


def cost(side: str, folder: Path, out: Path, model: Path) -> Cost:
    """Run one side over a folder in a process of its own, for the second time where something is compiled first."""
    if side == "script":
        return timed([sys.executable, "-c", PEER, str(folder), str(out)])
    given = ["--channels", "conf/ingest/rig.yaml", "--names", NAMES, "--output", str(out)]
    given += ["--model", str(model)] if side.startswith("model") else []
    given += [] if side.endswith("cores") else ["--workers", "1"]
    command = [sys.executable, "-c", BARE] if side.endswith("bare") else CLI
    used = timed([*command, "estimate", str(folder), *given], 1)  # 1: a recording holds what the model does not know
    if not (out / "friction.html").is_file():
        raise RuntimeError(f"{side} over {folder} wrote no page")
    return used


def timed(command: list[str], *allowed: int) -> Cost:
    """Return what a process costs, workers included; it may end with a status of 0, or those ``allowed``."""
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1")}
    with tempfile.TemporaryFile("w+") as log:
        started = time.monotonic()
        child = subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(child.pid, 0)
        clock_s, child.returncode = time.monotonic() - started, os.waitstatus_to_exitcode(status)
        if child.returncode not in (0, *allowed):
            log.seek(0)
            raise RuntimeError(f"{command} failed with status {child.returncode}: {log.read()[-2000:]}")
    return Cost(used.ru_utime + used.ru_stime, clock_s, used.ru_maxrss / 1024.0)


def line(case: str, rows: int, size_mb: float, side: str, own: Cost, script: Cost) -> str:
    """Return a line of the table."""
    about = f"{case:16}{rows:12d}{size_mb:8.0f}" if side == "script" else " " * 36
    cpu, clock, memory = own.cpu_s / script.cpu_s, own.clock_s / script.clock_s, own.peak_mb / script.peak_mb
    return f"{about}  {side:14}{rows / own.cpu_s:12.0f}{cpu:7.2f}{clock:7.2f}{own.peak_mb:8.0f}{memory:8.2f}\n"


if __name__ == "__main__":
    sys.exit(main())
