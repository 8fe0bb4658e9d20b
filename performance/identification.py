"""CPU time of identifying LuGre: from logs, in a notebook, and in the pipeline.

    python performance/identification.py [--seeds 0 1 2] [--folder FOLDER] [--stage]

The rig records two campaigns for each seed, with a row every 5 ms. ``identify`` gets 16 recordings of a minute.
``cf.LugreEstimator(cylinder).fit`` gets ten minutes of the condition with the smallest friction. The script prints the
CPU time of each, without imports, and the mean absolute error of each model. ``--stage`` also runs the pipeline's stage
``lugre`` in this folder, imports included; it needs the results of ``dvc repro offset``. ``FOLDER`` keeps the logs for
the next run, and the identified parameters with their intervals.
"""

import argparse
import itertools
import json
import resource
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from service_process import CLI

import cylinder_friction as cf
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.rig.sensors import write_logger_csv

CYLINDER = cf.Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
RULES = "conf/ingest/rig.yaml"
MINUTES = 10


def main() -> None:
    """Print one line for each seed and case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="*", default=[0], help="of the rig's campaigns")
    parser.add_argument("--folder", type=Path, help="folder that keeps logs and parameters")
    parser.add_argument("--stage", action="store_true", help="also run the stage lugre in this folder")
    options = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    with tempfile.TemporaryDirectory() as scratch:
        for seed in options.seeds:
            print_seed((options.folder or Path(scratch)) / f"seed{seed}", seed)
    if options.stage:
        print_stage()


def print_seed(folder: Path, seed: int) -> None:
    """Record both campaigns of a seed unless the folder has them, identify on both, and print CPU time and errors."""
    of_all = recorded(folder / "16 recordings", CampaignPlan(seed, sessions_per_condition=2))
    of_one = recorded(folder / "10 minutes", CampaignPlan(seed, sessions_per_condition=MINUTES // 2), MINUTES)
    found = {}
    seconds, models = cpu_s(lambda: cf.identify_logs(of_all, CYLINDER, folder / "models", channels=RULES))
    for model in models.models:
        assert model.found is not None, model.why_not
        found[f"identify, {model.title}"] = model.found
    print(f"seed {seed}: identify {seconds:.1f} s")
    labelled = cf.label(cf.read_recordings(of_one, RULES, CYLINDER), CYLINDER)
    seconds, lugre = cpu_s(lambda: cf.LugreEstimator(CYLINDER).fit(labelled))
    print(f"seed {seed}: LugreEstimator.fit {seconds:.1f} s")
    assert lugre.identification is not None
    found["fit, LuGre"] = lugre.identification
    for name, each in found.items():
        print(f"  {name}: {each.error_n:.4f} N, {each.error_percent:.3f} % of mean |friction|, {each.velocity}")
    content = {
        name: {"error_n": each.error_n, "parameters": asdict(each.parameters), "intervals": each.intervals}
        for name, each in found.items()
    }
    (folder / "identified.json").write_text(json.dumps(content, indent=1))


def recorded(folder: Path, plan: CampaignPlan, count: int | None = None) -> Path:
    """Write the first recordings of a campaign as the logger would, unless the folder is there."""
    if not folder.exists():
        folder.mkdir(parents=True)
        for recording in itertools.islice(campaign(CYLINDER, plan), count):
            write_logger_csv(folder / f"{recording.metadata.name}.csv", recording.logger)
    return folder


def print_stage() -> None:
    """Run the stage, and print its CPU time and the training errors."""
    subprocess.run([*CLI, "stage", "lugre"], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"stage lugre: {used.ru_utime + used.ru_stime:.1f} s")
    record = json.loads(Path("reports/runs/lugre.json").read_text("utf-8"))
    for name, percent in record["metrics"].items():
        print(f"  {name}: {percent:.4f} %")


def cpu_s(job: Callable[[], Any]) -> tuple[float, Any]:
    """Run a job; return its CPU time [s] and its result."""
    start = time.process_time()
    result = job()
    return time.process_time() - start, result


if __name__ == "__main__":
    main()
