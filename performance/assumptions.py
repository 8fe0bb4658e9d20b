"""What becomes of the label's bounds if an assumption behind them does not hold? The table of docs/trust.md.

    python performance/assumptions.py [--seeds N] [--first-seed N] [ASSUMPTION ...]

For each assumption, the simulated rig records campaigns in which it is broken by an option of the bench. The logs are
read as ``estimate`` reads them. Prints, per assumption: the share of rows in which bounds hold true friction, the same
of the worst recording, their half width over that of the unbroken bench, and in how many recordings a command names
what is wrong. ``unbroken`` is the bench with everything as stated.
"""

import argparse
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from sentences import NAMES, WEIGHT_N, World, simulated, write_logs

from cylinder_friction.estimation.friction_of_logs import LabelledLogs
from cylinder_friction.estimation.identification import MOST_ROWS
from cylinder_friction.estimation.results import load_left
from cylinder_friction.labelling.mass import missing_mass
from cylinder_friction.recordings.conversion import logged_files
from cylinder_friction.recordings.logs import find_logs

UNBROKEN = "unbroken"
KEPT = {"zeros": "kept"}
ASSUMPTIONS = {
    UNBROKEN: World(),
    "zeros within the stated accuracy": World(0.6, 0.05),
    "zeros drawn anew, if stated as zeroed": World(options=KEPT),
    "zeros kept, if not stated as zeroed": World(zeroed=False),
    "equal asymmetry of all sessions": World(options={"asymmetry_sd": 0.02}),
    "equal asymmetry of all conditions": World(options={"asymmetry_by_condition": 0.1}),
    "asymmetry within ± 30 %": World(options={"asymmetry_by_condition": 0.8}),
    "no load but the stated one": World(options={"weight_n": WEIGHT_N}),
    "moving mass as stated": World(options={"weight_n": WEIGHT_N}, load=f"{WEIGHT_N:g}+-40", mass_stated=0.1),
    "friction follows speed at once": World(options={"ageing": 0.07, "position_step_m": 1e-4}),
    "sensors at the cylinder": World(options={"line_loss_bar": 6.0}),
    "sensors at the cylinder, small loss": World(options={"line_loss_bar": 0.5}),
    "line loss within the stated ± 75 %": World(options={"line_loss_bar": 3.0}, line_stated=0.7),
    "cushions seen by the pressure sensors": World(options={"cushions_unseen": True}),
    "pressures without delay": World(options={"pressure_lag_s": 0.02}),
    "position equally exact throughout": World(noisy_position=True),
    "clock without jitter": World(options={"jitter": 1.0}),
}


def rows_of(world: World, seed: int) -> Iterator[dict[str, float]]:
    """Yield what became of each recording."""
    made = simulated(world, seed, quick=False)
    cylinder = replace(made.cylinder, moving_mass_kg=world.mass_stated * made.cylinder.moving_mass_kg)
    with tempfile.TemporaryDirectory() as scratch:
        mapping, load = write_logs(made, Path(scratch)), world.load
        logs = find_logs(f"{scratch}/logs/*.csv", mapping, cylinder, names=NAMES, load=load)
        run = LabelledLogs(logs, logged_files(logs), Path(scratch) / "kept", None)
        for each, _ in run.recordings(MOST_ROWS):
            truth = made.own(each.name)[0].truth
            truth_n = np.interp(each.column("time_s"), truth["time_s"], truth["friction_n"])
            lower_n, upper_n, rows = each.column("lower_n"), each.column("upper_n"), each.usable()
            doubts = (
                run.offsets[each.metadata.session].doubt,
                run.loss_in_words(),
                load_left(run.friction.entry(each, load)),
                missing_mass(each, cylinder),
                *each.metadata.remarks,
            )
            yield {
                "held": 100.0 * float(np.mean(((lower_n <= truth_n) & (truth_n <= upper_n))[rows])),
                "half": 0.5 * float(np.mean((upper_n - lower_n)[rows])),
                "named": float(any(doubts)),
            }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [name for name in ASSUMPTIONS if name != UNBROKEN]
    parser.add_argument("assumptions", metavar="ASSUMPTION", nargs="*", default=names, help=f"of: {'; '.join(names)}")
    parser.add_argument("--seeds", type=int, default=3, help="campaigns of each")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first campaign")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    seeds, whole_n = range(arguments.first_seed, arguments.first_seed + arguments.seeds), 0.0
    for name in (UNBROKEN, *arguments.assumptions):
        table = pd.DataFrame([row for seed in seeds for row in rows_of(ASSUMPTIONS[name], seed)])
        whole_n = whole_n or float(table["half"].mean())
        shown = {
            "assumption": name,
            "recordings": len(table),
            "held %": table["held"].mean(),
            "worst %": table["held"].min(),
            "width": table["half"].mean() / whole_n,
            "named": int(table["named"].sum()),
        }
        print(pd.DataFrame([shown]).round(1).to_string(index=False, header=name == UNBROKEN), flush=True)


if __name__ == "__main__":
    main()
