"""The comparison for several campaign seeds: each is recorded, searched, trained and compared from scratch.

    python performance/campaign_seeds.py 1 2 3 [--keep=FOLDER] [OVERRIDE ...]

Prints, for each seed and condition, the default hybrid's error beside the estimators it has to beat, in percent of mean
|friction|, against the label and against true friction, whether it beats them, and the figures of ``true_friction.py``.

``CYLINDER_FRICTION_WORKERS`` names workers that take a seed each.
"""

import argparse
import contextlib
import os
import shutil
import sys
import tempfile
from functools import partial
from pathlib import Path

from true_friction import report

from cylinder_friction.commands.cli import main as cylinder_friction
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.run_record import STAGES as ALL_STAGES

PUBLISHED_BEST_PERCENT = 5.57
RIVALS = {
    "label": (("force_balance_low_pass", "ridge", "lugre", "pressure_lugre"), PUBLISHED_BEST_PERCENT),
    "truth": (("force_balance_unfiltered", "force_balance_paper"), float("inf")),
}
"""What the hybrid has to beat, beside a percentage, by what errors are against."""
STAGES = ALL_STAGES[: ALL_STAGES.index("register")]


def campaign(seed: int | None, overrides: list[str], folder: Path) -> dict[str, dict[str, dict[str, float]]]:
    """Run the pipeline up to ``compare`` in an empty folder, with this seed or the default one; returns its metrics."""
    shutil.copytree("conf", folder / "conf")
    os.environ["MLFLOW_TRACKING_URI"] = f"sqlite:///{folder / 'mlflow.db'}"
    seeded = overrides if seed is None else [*overrides, f"record.seed={seed}"]
    with contextlib.chdir(folder):
        for command in (["params", *seeded], *(["stage", stage] for stage in STAGES)):
            if cylinder_friction(command):
                raise RuntimeError(f"seed {seed}: {' '.join(command)} failed; it has printed why")
    metrics: dict[str, dict[str, dict[str, float]]] = read_json(folder / "reports/metrics.json")
    return metrics


def main() -> int:
    """Print the table; returns 1 if any claim fails. Arguments are seeds, and Hydra overrides for all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the campaigns there")
    parser.add_argument("arguments", nargs="*", help="seeds, and Hydra overrides for all of them")
    given = parser.parse_intermixed_args()
    seeds = [int(argument) for argument in given.arguments if argument.isdecimal()] or [1, 2, 3]
    overrides = [argument for argument in given.arguments if not argument.isdecimal()]
    return compare_seeds(seeds, overrides, given.keep)


def place(keep: Path | None, name: str) -> contextlib.AbstractContextManager[str]:
    """Return where a campaign lies: below the folder that keeps it, or in one that is removed."""
    return contextlib.nullcontext(str(keep / name)) if keep else tempfile.TemporaryDirectory()


def compare_seeds(seeds: list[int], overrides: list[str], keep: Path | None) -> int:
    """Print the comparison of each seed; returns 1 if any claim fails."""
    failed, lines, found = [], [], []
    with contextlib.ExitStack() as stack:
        workers = stack.enter_context(workers_from_environment())
        folders = [Path(stack.enter_context(place(keep, f"seed_{seed}"))) for seed in seeds]
        pieces = [partial(campaign, seed, overrides, folder) for seed, folder in zip(seeds, folders, strict=True)]
        results = workers.all_in_order(pieces, [f"seed {seed}" for seed in seeds])
        for seed, folder, metrics in zip(seeds, folders, results, strict=True):
            sys.stdout.write(f"seed {seed} {' '.join(overrides)}\n{report(folder)}\n\n")
            found.append((seed, metrics))
    for seed, metrics in found:
        for against, (rivals, bound) in RIVALS.items():
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
    sys.exit(main())
