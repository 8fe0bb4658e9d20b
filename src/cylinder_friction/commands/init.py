"""The command ``init``: make a project's folder, in which the pipeline runs on the installed package."""

import argparse
import shutil
import tomllib
from pathlib import Path

from cylinder_friction.commands.code import write_code
from cylinder_friction.files.whole_files import write_text
from cylinder_friction.import_graph import SOURCE
from cylinder_friction.params.checking import load_params
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.sensors import write_logger_csv
from cylinder_friction.tracking.repository import CODE_FILE, asked_git

SHIPPED = "cylinder_friction/project"
EXAMPLE = "condition1_session01_recording01.csv"
README = f"""# Friction of a hydraulic cylinder

Parameters are in `conf/`, composed by `cylinder-friction params` into `params.yaml`, which the pipeline reads.

- One log: `cylinder-friction estimate {EXAMPLE} --channels conf/ingest/rig.yaml`
- The pipeline, in about a minute: `cylinder-friction params experiment=smoke`, then `dvc repro`
- Your logs: see `conf/ingest/own.yaml`; `cylinder-friction params experiment=own`, then `dvc repro`
- Results: `cylinder-friction summary`, `cylinder-friction ui`, `cylinder-friction serve`
- `{CODE_FILE}` holds the hash of each stage's code: after an upgrade of the package `dvc repro` runs what changed.
  Commit it with everything else, so that `cylinder-friction lineage` finds the way back from a model.
"""
IGNORED_IN_A_CHECKOUT = f"/{CODE_FILE}\n"
"""Git holds the code itself in a checkout, so only a project commits the hashes."""


def make_project(folder: Path) -> None:
    """Write a project's files into a new folder, and make it a git repository unless it is in one or git is missing.

    Raises:
        FileExistsError: The folder is not empty.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FileExistsError(f"{folder}: there is something already; name a new folder, or an empty one")
    try:
        _fill(folder)
    except BaseException:  # a full disk or Ctrl-C must not leave half a project
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _fill(folder: Path) -> None:
    for target, source in _shipped().items():
        (folder / target).parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copyfile)(source, folder / target)
    ignored = folder / ".gitignore"
    write_text(ignored, ignored.read_text(encoding="utf-8").replace(IGNORED_IN_A_CHECKOUT, ""))
    write_text(folder / "README.md", README)
    write_code(folder)
    params = load_params(folder / "params.yaml")
    recordings = campaign(params.cylinder, params.record)
    write_logger_csv(folder / EXAMPLE, next(iter(recordings)).logger)
    if asked_git(folder, "rev-parse", "--show-toplevel")[0] is None and asked_git(folder, "init", "--quiet")[0] is None:
        config = folder / ".dvc/config"  # without git
        write_text(config, config.read_text(encoding="utf-8").replace("[core]\n", "[core]\n    no_scm = true\n"))


def _shipped() -> dict[str, Path]:
    """Map a project's paths to the shipped files: beside the code, or in the checkout."""
    packed = SOURCE / SHIPPED
    if packed.is_dir():
        return {path.name: path for path in packed.iterdir()}
    checkout = SOURCE.parent
    build = tomllib.loads((checkout / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    targets = build["targets"]["wheel"]["force-include"]
    return {target.removeprefix(f"{SHIPPED}/"): checkout / source for source, target in targets.items()}


def run(options: argparse.Namespace) -> None:
    make_project(options.folder)
    print(f"made {options.folder}; {options.folder / 'README.md'} has the next commands")
