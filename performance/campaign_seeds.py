"""The comparison for several campaign seeds: each is recorded, searched, trained and compared from scratch.

    python performance/campaign_seeds.py 1 2 3 [--keep=FOLDER] [OVERRIDE ...]

Prints, for each seed and condition, the default hybrid's error beside the estimators it has to beat, in percent of mean
|friction|, against the label and against true friction, whether it beats them, and the figures of ``true_friction.py``.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sys
import tempfile
from pathlib import Path

from true_friction import report

from cylinder_friction.commands.cli import main as cylinder_friction
from cylinder_friction.run_record import STAGES as ALL_STAGES

PUBLISHED_BEST_PERCENT = 5.57
LABEL_RIVALS = ("force_balance_low_pass", "ridge", "lugre", "pressure_lugre")
TRUTH_RIVALS = ("force_balance_unfiltered", "force_balance_paper")
STAGES = ALL_STAGES[: ALL_STAGES.index("register")]


def campaign(seed: int, overrides: list[str], folder: Path) -> dict[str, dict[str, dict[str, float]]]:
    """Run the pipeline up to ``compare`` in an empty folder with this seed; returns its metrics."""
    shutil.copytree("conf", folder / "conf")
    os.environ["MLFLOW_TRACKING_URI"] = f"sqlite:///{folder / 'mlflow.db'}"
    with contextlib.chdir(folder):
        for command in (["params", *overrides, f"record.seed={seed}"], *(["stage", stage] for stage in STAGES)):
            if cylinder_friction(command):
                sys.exit(1)  # the command has printed why
    metrics: dict[str, dict[str, dict[str, float]]] = json.loads((folder / "reports/metrics.json").read_text("utf-8"))
    return metrics


def main(arguments: list[str]) -> int:
    """Print the table; returns 1 if any claim fails. Arguments: seeds, Hydra overrides, where to keep the campaigns."""
    seeds = [int(argument) for argument in arguments if argument.isdecimal()] or [1, 2, 3]
    kept = [argument.removeprefix("--keep=") for argument in arguments if argument.startswith("--keep=")]
    overrides = [argument for argument in arguments if not argument.isdecimal() and not argument.startswith("--keep=")]
    failed = []
    lines = []
    for seed in seeds:
        with contextlib.nullcontext(f"{kept[0]}/seed_{seed}") if kept else tempfile.TemporaryDirectory() as folder:
            metrics = campaign(seed, overrides, Path(folder))
            sys.stdout.write(f"seed {seed} {' '.join(overrides)}\n{report(Path(folder))}\n\n")
        for against, rivals, bound in (
            ("label", LABEL_RIVALS, PUBLISHED_BEST_PERCENT),
            ("truth", TRUTH_RIVALS, float("inf")),
        ):
            for condition in sorted(metrics["hybrid"]):
                own = metrics["hybrid"][condition][f"{against}_percent"]
                others = {name: metrics[name][condition][f"{against}_percent"] for name in rivals}
                holds = own < min(bound, *others.values())
                if not holds:
                    failed.append((seed, against, condition))
                words = "  ".join(f"{name} {value:.2f}" for name, value in others.items())
                verdict = "below all" if holds else "NOT below all"
                lines.append(f"seed {seed}  {against}  {condition}  hybrid {own:.2f}  {words}  {verdict}")
    sys.stdout.write("MAE, % of mean |friction| on held-out recordings\n" + "\n".join(lines) + "\n")
    sys.stdout.write(f"{len(lines) - len(failed)} of {len(lines)} claims hold\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
