"""The crane's recordings rewritten as a TwinCAT Scope exports them, and read through ``ingest init`` alone.

    python public_data/scope_export.py --data FOLDER

FOLDER holds ``crane``. Each run is written as ``Name,<channels>,Name,<channels>,...`` with a time column in
milliseconds for each rate. The command prints its friction and load as read from both files, and by how much the labels
of the two differ.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cylinder_friction.commands.cli import main as command
from cylinder_friction.recordings.reading_logs import read_recordings
from public_data import CYLINDERS, labelled, recordings_of
from public_figures import CRANE_RUNS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cylinder_friction.arrays import Array
    from cylinder_friction.labelling.session import SessionIdentification
    from cylinder_friction.recordings.recording import Recording

RULES = Path(__file__).parents[2] / "conf/ingest/rules"

BANNER = (
    "Name,Crane,\nFile,D:\\scope\\crane.csv,\nStarttime of export,134179488000000000,14. March 2026,08:00:00.000\n"
    "Endtime of export,134179488600000000,14. March 2026,08:01:00.000\n\n\n"
)

Group = tuple[float, "Mapping[str, Array]"]  # Time between two rows [ms], and channels by name, each of shape ``(n,)``


def scope_text(groups: Sequence[Group], delimiter: str = ",", decimal: str = ".", end: str = "") -> str:
    """Return a scope's export; below a group that ends before others stand blanks, and ``end`` behind all."""
    names = [name for _, channels in groups for name in ("Name", *channels)]
    columns = [
        [repr(float(value)).removesuffix(".0").replace(".", decimal) for value in values]
        for step_ms, channels in groups
        for first in [next(iter(channels.values()))]
        for values in (step_ms * np.arange(len(first)), *channels.values())
    ]
    rows = max(map(len, columns))
    lines = []
    for row in range(rows):
        cells = [column[row] if row < len(column) else " " for column in columns]
        while cells[-1] == " ":
            cells.pop()
        lines.append(delimiter.join(cells))
    return BANNER.replace(",", delimiter) + "\n".join([delimiter.join(names), "", *lines, end])


def crane_groups(log: pd.DataFrame) -> list[Group]:
    """Return the crane's channels as groups of one time column each; the supply is logged ten times slower."""
    pressures = [name for name in log.columns if "_p" in name]
    others = [name for name in log.columns[1:-1] if name not in pressures]
    return [
        (10.0, {name: log[name].to_numpy() for name in pressures}),
        (100.0, {"pS_bar": log["pS_bar"].to_numpy()[::10]}),
        *((10.0, {name: log[name].to_numpy()}) for name in others),
    ]


def both_readings(data: Path, run: str, folder: Path) -> dict[str, tuple[list[Recording], SessionIdentification]]:
    """Return the labelled recordings of a crane's run, by the file that they were read from."""
    path = data / f"crane/{run}_230425__100Hz.csv.gz"
    scope, mapping = folder / f"crane_{run}.csv", folder / "ingest/crane.yaml"
    scope.write_text(scope_text(crane_groups(pd.read_csv(path)), end="EOF\n"), encoding="utf-8")
    shutil.copytree(RULES, mapping.parent / "rules", dirs_exist_ok=True)
    mapping.unlink(missing_ok=True)
    command(["ingest", "init", str(scope), "--output", str(mapping)])
    from_scope = read_recordings(scope, mapping, CYLINDERS["crane"], load="position")
    return {
        "its present file": labelled(recordings_of(path, "crane"), "crane", load="position"),
        "the scope's layout": labelled(from_scope, "crane", load="position"),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    data = parser.parse_args().data
    for run in CRANE_RUNS:
        with tempfile.TemporaryDirectory() as folder:
            readings = both_readings(data, run, Path(folder))
        for source, (recordings, found) in readings.items():
            load = found.load
            assert load is not None
            rows = sum(map(len, recordings))
            print(f"{run} from {source}: {rows} rows, Coulomb {load.coulomb_n:.3f} N, load {load.load_range_n}")
        one, other = ([each.column("friction_n") for each in recordings] for recordings, _ in readings.values())
        print(f"  labels differ by {np.abs(np.concatenate(one) - np.concatenate(other)).max():.3g} N at most")


if __name__ == "__main__":
    main()
