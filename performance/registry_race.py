"""Race two clones for the champion's place on one server: the better of their candidates must end as champion.

Each race is for a registered model of its own. Both clones begin at the same moment, each in a process of its own; who
has the better candidate alternates. Errors are made up, models are copies of one that a finished pipeline has trained.

    python performance/registry_race.py [--races 20] [--store postgresql] [--pipeline .]
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import shutil
import sys
import tempfile
import time
from multiprocessing.synchronize import Barrier
from pathlib import Path

from mlflow import MlflowClient
from team_servers import WITHOUT_ADDRESSES, server_on

from cylinder_friction.recordings.files import hash_of, write_json
from cylinder_friction.tracking.gate import Candidate, Registered
from cylinder_friction.tracking.registry import ALIAS, register

MEAN_PERCENT = {"incumbent": 2.0, "worse": 1.575, "better": 1.417}
COPIED = ("models/hybrid", "models/registered.json", "reports/runs/train.json")


def clone_of(pipeline: Path, folder: Path) -> None:
    """Write what a candidate is made of: another hybrid than any other clone's."""
    for name in COPIED:
        source, target = pipeline / name, folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)
    (folder / ".dvc").mkdir()
    path = folder / "models/hybrid/estimator.json"
    path.write_text(path.read_text(encoding="utf-8") + " " * sum(folder.name.encode()), encoding="utf-8")
    record = folder / "reports/runs/train.json"
    content = json.loads(record.read_text(encoding="utf-8"))
    write_json(record, {**content, "artifacts": {"models/hybrid": hash_of(path.parent)}})


def candidate_in(folder: Path, name: str, mean_percent: float) -> Candidate:
    content = json.loads((folder / "models/registered.json").read_text(encoding="utf-8"))
    content["candidate"].setdefault("tolerance_percent", content.pop("tolerance_percent", 0.1))
    stored = Registered.from_dict(content).candidate
    errors_percent = dict.fromkeys(stored.errors_percent, mean_percent)
    key = hash_of(folder / "models/hybrid")
    return Candidate(
        name, "models/hybrid", key, errors_percent, "md5", stored.origin, stored.example, stored.tolerance_percent
    )


def enter(folder: Path, name: str, figures: dict[str, float], barrier: Barrier | None = None) -> None:
    """Register the clone's model; ``figures`` are the mean errors [percent] by the hash of a model."""
    candidate = candidate_in(folder, name, figures[hash_of(folder / "models/hybrid")])
    if barrier is not None:
        barrier.wait()
    register(candidate, folder, lambda model: dict.fromkeys(candidate.errors_percent, figures[hash_of(model)]))


def race(number: int, clones: dict[str, Path], client: MlflowClient) -> bool:
    """Return whether the better one of two is champion in the end."""
    roles = ("worse", "better") if number % 2 else ("better", "worse")
    keys = {name: hash_of(folder / "models/hybrid") for name, folder in clones.items()}
    figures = {keys["incumbent"]: MEAN_PERCENT["incumbent"]}
    figures |= {keys[name]: MEAN_PERCENT[role] for name, role in zip(("left", "right"), roles, strict=True)}
    name = f"race-{time.time_ns()}"
    enter(clones["incumbent"], name, figures)
    barrier = multiprocessing.get_context("fork").Barrier(2)
    context = multiprocessing.get_context("fork")
    runners = [context.Process(target=enter, args=(clones[one], name, figures, barrier)) for one in ("left", "right")]
    for runner in runners:
        runner.start()
    for runner in runners:
        runner.join()
    champion = client.get_model_version_by_alias(name, ALIAS)
    won = figures[champion.tags["model_key"]] == MEAN_PERCENT["better"]
    versions = sorted(client.search_model_versions(f"name = '{name}'"), key=lambda one: int(one.version))
    print(f"race {number:2d}: champion {figures[champion.tags['model_key']]} %", flush=True)
    for one in versions[1:]:
        print(
            f"         version {one.version}, {figures[one.tags['model_key']]} %: {one.tags['gate_reason']}", flush=True
        )
    return won and all(runner.exitcode == 0 for runner in runners)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--races", type=int, default=20)
    parser.add_argument("--store", choices=("sqlite", "postgresql"), default="sqlite", help="of the server")
    parser.add_argument("--pipeline", type=Path, default=Path(), help="folder of a finished pipeline")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        clones = {name: folder / name for name in ("incumbent", "left", "right")}
        for clone in clones.values():
            clone_of(options.pipeline, clone)
        with server_on(options.store, folder) as url:
            os.environ |= {"MLFLOW_TRACKING_URI": url, **WITHOUT_ADDRESSES}
            won = sum(race(number, clones, MlflowClient(url)) for number in range(options.races))
    print(f"the better one is champion after {won} of {options.races} races")
    return 0 if won == options.races else 1


if __name__ == "__main__":
    sys.exit(main())
