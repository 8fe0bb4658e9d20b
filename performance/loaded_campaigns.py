"""The default pipeline without an external load, with a measured one, and with a crane's, identified from position.

    python performance/loaded_campaigns.py [--keep FOLDER] [OVERRIDE ...]

Each is recorded, searched, trained and compared from scratch. Prints, for each condition, against label and true
friction, the hybrid's error and how many times that without load it is, beside the force balance less the load, tuned
low-pass; and how much of true friction the hybrid's bounds hold.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from campaign_seeds import campaign, place

CAMPAIGNS = {
    "none": [],
    "measured": ["record=loaded", "ingest=rig_loaded"],
    "position": ["record=boom", "ingest=rig_boom"],
}
HEADER = "load      against  condition  hybrid  times none  low-pass balance  bounds hold  worst session  width"


def main() -> None:
    """Print the table; Hydra overrides are for all campaigns."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the campaigns there; those there are read")
    parser.add_argument("overrides", nargs="*")
    given = parser.parse_intermixed_args()
    lines = [HEADER]
    without: dict[str, dict[str, dict[str, float]]] = {}
    for load, overrides in CAMPAIGNS.items():
        with place(given.keep, load) as name:
            folder = Path(name)
            finished = folder / "reports/metrics.json"
            metrics = json.loads(finished.read_text("utf-8")) if finished.is_file() else None
            if metrics is None:
                folder.mkdir(parents=True, exist_ok=True)
                metrics = campaign(None, [*overrides, *given.overrides], folder)
            held = json.loads((folder / "reports/coverage.json").read_text("utf-8"))
        without = without or metrics
        for against in ("label", "truth"):
            bounds = {each["condition"]: each for each in held if each["reference"] == against}
            for condition, own in sorted(metrics["hybrid"].items()):
                key, covered = f"{against}_percent", bounds[condition]
                error, low_pass = own[key], metrics["force_balance_low_pass"][condition][key]
                times = error / without["hybrid"][condition][key]
                lines.append(
                    f"{load:9} {against:8} {condition:9}  {error:4.2f} %{times:10.2f}"
                    f"{low_pass:14.2f} %{covered['held_percent']:14.1f} %{covered['worst_session_percent']:12.1f} %"
                    f"{covered['mean_width_n']:8.0f} N"
                )
    sys.stdout.write("MAE, % of mean |friction|, held-out recordings\n" + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
