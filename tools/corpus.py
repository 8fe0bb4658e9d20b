"""What ``estimate`` computes from many logs: stored columns, recorded again on purpose, and two commits compared.

    python tools/corpus.py record "REASON"      # after a change that is meant to change numbers
    python tools/corpus.py compare A [B]        # after one that is not: commit A and B, or A and this checkout
    python tools/corpus.py hashes               # the hash of every column as JSON, which `compare` calls

`tests/estimation/test_corpus.py` compares each column with the stored one to 1e-9 of its span, because processors
differ in last digits. `compare` runs two commits on one machine and asks for equal bits.

Stored are, per column, its count, mean, mean magnitude and root mean square, and every fiftieth row of the forces,
flags and usable rows that the package computed. No measured column is stored: some of the logs have no licence.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    Columns = Mapping[str, NDArray[np.float64]]
    """Columns of recordings by ``case/recording/column``, each of shape ``(rows,)``."""

ROOT = Path(__file__).resolve().parents[1]
STORED = ROOT / "tests/corpus"
REASONS = STORED / "REASONS.md"
NO_DATA = ROOT / "no recordings of others"
"""Default of ``--data``: without such a folder the groups of other people's recordings are left out."""
GROUPS = ("rig", "rig-model", "formats", "field-logs", "crane")
CYLINDER = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6.0"
KEPT_ROWS = ("friction_n", "lower_n", "upper_n", "label_n", "load_force_n", "usable", "flags", "levels")
"""Columns of which rows are stored; ``levels`` is the friction at each speed, pressure and direction [N]."""
STRIDE = 50
"""One row in so many is stored; of ``levels`` every one."""
TOLERANCE = 1e-9
"""How far a value may be from the stored one, as a share of its column's span."""


@dataclass(frozen=True)
class Case:
    """One call of ``estimate``: its name, the logs, and its options."""

    name: str
    logs: Path
    options: tuple[str, ...] = ("--cylinder", CYLINDER)


def cases(group: str, scratch: Path, data: Path) -> Iterator[Case]:
    """Yield the calls of a group; logs that are no files of others are written into ``scratch``."""
    if group.startswith("rig"):
        model = ("--model", str(ROOT / "tests/golden/model")) if group == "rig-model" else ()
        channels = ("--channels", str(ROOT / "conf/ingest/rig.yaml"))
        yield Case("rig", rig_logs(scratch / "rig"), ("--cylinder", CYLINDER, *channels, *model))
    elif group == "formats":
        yield from (Case(log.stem, log) for log in logs_of_formats(scratch / "formats"))
    elif group == "crane":
        given = ("--cylinder", str(ROOT / "conf/cylinder/hmf_2020k_jib.yaml"))
        yield Case("crane", data / "crane/scope", (*given, "--channels", str(ROOT / "conf/ingest/crane.yaml")))
    else:
        for log in sorted((data / "field-logs").glob("*/*")):
            if log.suffix == ".yaml":
                continue
            name = f"{log.parent.name}:{log.name}"
            yield Case(name, log)
            for mapping in sorted(log.parent.glob("*.yaml")):
                yield Case(f"{name}:{mapping.stem}", log, (*Case.options, "--channels", str(mapping)))


def rig_logs(folder: Path) -> Path:
    """Write the first ten recordings of the shipped campaign as the rig's logger does; return the folder."""
    import yaml

    from cylinder_friction.params.checking import check_params
    from cylinder_friction.rig.campaign import campaign
    from cylinder_friction.rig.sensors import write_logger_csv

    params = check_params(yaml.safe_load((ROOT / "params.yaml").read_text(encoding="utf-8")), "params.yaml")
    folder.mkdir()
    for recording in islice(campaign(params.cylinder, params.record), 10):
        write_logger_csv(folder / f"{recording.metadata.name}.csv", recording.logger)
    return folder


def logs_of_formats(folder: Path) -> list[Path]:
    """Write the same strokes once in each format that tests write; return the files."""
    sys.path.append(str(ROOT / "tests"))
    from format_writers import SAMPLES
    from logger_files import made_log

    table = made_log(2000).set_axis(["time", "P1", "P2", "pos"], axis="columns")
    units = {"time": "s", "P1": "bar", "P2": "bar", "pos": "mm"}
    folder.mkdir()
    for kind, sample in SAMPLES.items():
        sample.write(folder / kind, table, units)
    return [folder / kind for kind in SAMPLES]


def computed(group: str, data: Path = NO_DATA) -> dict[str, NDArray[np.float64]]:
    """Run ``estimate`` on the logs of a group; return all columns of all results.

    Logs that are refused have no columns.
    """
    from cylinder_friction.commands.cli import main

    columns: dict[str, NDArray[np.float64]] = {}
    with tempfile.TemporaryDirectory(prefix="corpus-") as name:
        for case in cases(group, Path(name), data):
            out = Path(name) / "out"
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                main(["estimate", str(case.logs), *case.options, "--output", str(out)])
            for result in sorted(out.glob("*.parquet")):
                table = pd.read_parquet(result).select_dtypes(["number", "bool"])
                key = f"{case.name}/{result.stem}"
                columns |= {f"{key}/{column}": table[column].to_numpy(np.float64) for column in table}
            if (summary := out / "summary.json").is_file():
                for each in json.loads(summary.read_text(encoding="utf-8"))["recordings"]:
                    levels = [level["friction_n"] for level in each["levels"]]
                    columns[f"{case.name}/{each['name']}/levels"] = np.array(levels, dtype=np.float64)
            shutil.rmtree(out, ignore_errors=True)
    return columns


def hashes(columns: Columns) -> dict[str, str]:
    """Return the hash of the bits of each column."""
    return {name: hashlib.sha256(values.tobytes()).hexdigest() for name, values in columns.items()}


def shortened(columns: Columns) -> dict[str, NDArray[np.float64]]:
    """Return what is stored of columns: their figures, and some rows of what the package computed."""
    stored = {f"{name}/figures": figures(values) for name, values in columns.items()}
    kept = [name for name in columns if name.rpartition("/")[2] in KEPT_ROWS]
    return stored | {name: columns[name][:: 1 if name.endswith("/levels") else STRIDE] for name in kept}


def figures(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return count, count of finite values, their mean, mean magnitude and root mean square, shape ``(5,)``."""
    known = values[np.isfinite(values)]
    if not len(known):
        return np.array([len(values), 0.0, 0.0, 0.0, 0.0])
    moments = known.mean(), np.abs(known).mean(), np.sqrt((known**2).mean())
    return np.array([len(values), len(known), *moments])


def differences(stored: Columns, columns: Columns) -> list[str]:
    """Return a line per stored column that is gone or differs by more than ``TOLERANCE`` of the column's span."""
    found, lines = shortened(columns), []
    for name, before in stored.items():
        if name not in found:
            lines.append(f"{name}: is no longer computed")
            continue
        now = found[name]
        if now.shape != before.shape or (np.isnan(now) != np.isnan(before)).any():
            lines.append(f"{name}: other rows have a value, or there are {len(now)} in place of {len(before)}")
            continue
        share = np.nanmax(np.abs(now - before), initial=0.0) / _span(columns[name.removesuffix("/figures")])
        if share > TOLERANCE:
            lines.append(f"{name}: differs by {share:.1e} of its span")
    return lines


def _span(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known) or np.abs(known).max() or 1.0) if len(known) else 1.0


def stored_columns(group: str) -> dict[str, NDArray[np.float64]]:
    """Load what is stored of a group."""
    with np.load(STORED / f"{group}.npz") as arrays:
        return dict(arrays)


def record(groups: Iterable[str], reason: str, data: Path) -> None:
    """Store columns anew, and add the reason with the groups that it changed to ``REASONS.md``."""
    changed = []
    for group in groups:
        columns = computed(group, data)
        before = stored_columns(group) if (STORED / f"{group}.npz").is_file() else {}
        lines = differences(before, columns)
        new = sorted(shortened(columns).keys() - before.keys())
        print("\n".join([f"{group}: {len(lines)} differ, {len(new)} new", *lines]))
        if lines or new:
            np.savez_compressed(STORED / f"{group}.npz", allow_pickle=False, **shortened(columns))
            changed.append(group)
    if changed:
        with REASONS.open("a", encoding="utf-8") as file:
            file.write(f"- {', '.join(changed)}: {reason}\n")


def hashes_of_commit(commit: str | None, groups: Iterable[str], data: Path) -> dict[str, str]:
    """Return the hashes that the code of a commit makes; None: of this checkout.

    A commit from before this script runs with this one.
    """
    with tempfile.TemporaryDirectory(prefix="corpus-") as name:
        root = ROOT if commit is None else Path(name)
        if commit is not None:
            command = ["git", "archive", commit]
            archive = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout
            with tarfile.open(fileobj=io.BytesIO(archive)) as files:
                files.extractall(root, filter="data")
        script = root / "tools/corpus.py"
        if not script.is_file():
            shutil.copy(__file__, script)
        only = [f"--only={group}" for group in groups]
        command = [sys.executable, str(script), f"--data={data.resolve()}", *only, "hashes"]
        environment = {**os.environ, "PYTHONPATH": str(root / "src")}
        done = subprocess.run(command, cwd=root, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout))


def unequal(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Return a line per column whose hashes differ, or that only one of two commits has."""
    lines = [f"{name}: only the first has it" for name in sorted(one.keys() - other.keys())]
    lines += [f"{name}: only the second has it" for name in sorted(other.keys() - one.keys())]
    return lines + [f"{name}: other bits" for name in sorted(one.keys() & other.keys()) if one[name] != other[name]]


def main() -> int:
    """Record, compare or hash, as the command line asks; return 1 if two commits differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--data", type=Path, default=NO_DATA, help="folder with crane and field-logs; without it they are left out"
    )
    parser.add_argument("--only", action="append", choices=GROUPS, help="a group; may be repeated; default: all")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("record").add_argument("reason", help="which change is meant to change what")
    compare = commands.add_parser("compare")
    compare.add_argument("commits", nargs="+", metavar="COMMIT", help="two, or one to compare with this checkout")
    commands.add_parser("hashes")
    given = parser.parse_args()
    folders = {"field-logs": given.data / "field-logs", "crane": given.data / "crane/scope"}
    groups = given.only or [each for each in GROUPS if folders.get(each, ROOT).is_dir()]
    if given.command == "record":
        record(groups, given.reason, given.data)
        return 0
    if given.command == "hashes":
        found = {
            f"{group}/{name}": each for group in groups for name, each in hashes(computed(group, given.data)).items()
        }
        print(json.dumps(found))
        return 0
    if len(given.commits) > 2:
        parser.error(f"compare takes one or two commits, got {len(given.commits)}")
    one, other = (hashes_of_commit(commit, groups, given.data) for commit in (*given.commits, None)[:2])
    lines = unequal(one, other)
    print("\n".join([*lines, f"{', '.join(groups)}: {len(lines)} of {len(one | other)} columns differ"]))
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
