"""Who is champion after a rollback and all that may follow it, on a team's server: a table.

    python performance/rollback_story.py [--store postgresql] [--pipeline .]

Works in a copy of a finished pipeline's repository. Its own model and all commands are real; the other candidates are
copies of that model with errors made up.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mlflow import MlflowClient
from registry_race import clone_of
from team_servers import WITHOUT_ADDRESSES, server_on

from cylinder_friction.recordings.files import hash_of, read_json
from cylinder_friction.tracking.gate import Registered
from cylinder_friction.tracking.registry import ALIAS, register

BIN = Path(sys.executable).parent
MAKE = ("make", f"VENV={BIN.parent}", "-o", f"{BIN.parent}/.installed")  # with the environment that this runs in
LEFT_OUT = (".venv", "mlflow.db*", "mlartifacts", ".*_cache", ".cylinder-friction")


def story(copy: Path, client: MlflowClient) -> list[str]:
    """Print what is done, who is champion then and what came of it; return the champions."""
    stored = Registered.from_dict(read_json(copy / "models/registered.json")).candidate
    names, figures = {stored.model_key: "the pipeline's"}, {stored.model_key: stored.errors_percent}
    clones: dict[str, Path] = {}

    def candidate(name: str, factor: float, tolerance_percent: float = 0.1) -> str:
        if name not in clones:
            clones[name] = copy.parent / name
            clone_of(copy, clones[name])
        key = hash_of(clones[name] / "models/hybrid")
        names[key] = name
        figures[key] = {condition: factor * error for condition, error in stored.errors_percent.items()}
        asks = replace(stored, model_key=key, errors_percent=figures[key], tolerance_percent=tolerance_percent)
        return register(asks, clones[name], lambda folder: figures[hash_of(folder)]).reason

    def command(*words: str) -> str:
        done = subprocess.run(words, cwd=copy, capture_output=True, text=True)
        if done.returncode != 0:
            raise OSError(f"{' '.join(words)} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
        return done.stdout

    def registered() -> str:
        command("dvc", "repro", "--force", "--single-item", "register")
        return Registered.from_dict(read_json(copy / "models/registered.json")).reason

    def tracked() -> str:
        return "; ".join(command("cylinder-friction", "track").splitlines()[-2:])

    def reproduced() -> str:
        return f"{command(*MAKE, 'reproduce').count('Running stage')} stages ran"

    steps: list[tuple[str, Callable[[], str]]] = [
        ("the pipeline registers", registered),
        ("better candidate B", lambda: candidate("B", 0.90)),
        ("cylinder-friction rollback", lambda: command("cylinder-friction", "rollback").strip()),
        ("cylinder-friction track", tracked),
        ("make reproduce", reproduced),
        ("B again, with another tolerance", lambda: candidate("B", 0.90, 0.2)),
        ("worse candidate C", lambda: candidate("C", 1.10)),
        ("better candidate D", lambda: candidate("D", 0.95)),
        ("cylinder-friction track", tracked),
        ("make reproduce", reproduced),
    ]
    champions = []
    for done, step in steps:
        outcome = step()
        version = client.get_model_version_by_alias(stored.model_name, ALIAS)
        champions.append(f"version {version.version}, {names[version.tags['model_key']]}")
        print(f"{done:32} {champions[-1]:26} {outcome}", flush=True)
    return champions


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", choices=("sqlite", "postgresql"), default="sqlite", help="of the server")
    parser.add_argument("--pipeline", type=Path, default=Path(), help="folder of a finished pipeline")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        copy = folder / "pipeline"
        shutil.copytree(options.pipeline, copy, symlinks=True, ignore=shutil.ignore_patterns(*LEFT_OUT))
        with server_on(options.store, folder) as url:
            os.environ |= {"MLFLOW_TRACKING_URI": url, "PATH": f"{BIN}:{os.environ['PATH']}", **WITHOUT_ADDRESSES}
            print(f"{'done':32} {'champion then':26} what came of it", flush=True)
            champions = story(copy, MlflowClient(url))
    expected = ["version 1, the pipeline's", "version 2, B", *["version 1, the pipeline's"] * 5, *["version 5, D"] * 3]
    print("as documented" if champions == expected else f"expected: {expected}")
    return 0 if champions == expected else 1


if __name__ == "__main__":
    sys.exit(main())
