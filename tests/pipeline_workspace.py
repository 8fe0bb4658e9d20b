"""Repositories of their own, in which tests run the shipped pipeline as a user does."""

import io
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from types import MappingProxyType
from unittest.mock import patch

from mlflow.tracking._tracking_service import utils as mlflow_stores

from copied_stores import copied
from cylinder_friction.commands.cli import main

PROJECT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent
MAKE = ("make", f"VENV={BIN.parent}", "-o", f"{BIN.parent}/.installed", "-o", f"{BIN.parent}/.installed-dev")
"""Make with the environment that the tests run in, so that nothing is installed."""


def environment() -> dict[str, str]:
    """Return the environment of a user who has activated this virtual environment and set nothing else."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("MLFLOW_", "DVC_"))}
    return {**kept, "PATH": f"{BIN}:{os.environ['PATH']}", "DVC_NO_ANALYTICS": "true"}


def run(
    folder: Path, *command: str, check: bool = True, given: Mapping[str, str] = MappingProxyType({})
) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, with what is ``given`` in its environment; its output is shown where it fails."""
    done = subprocess.run(command, cwd=folder, env={**environment(), **given}, capture_output=True, text=True)
    if check:
        assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}\n{done.stderr}"
    return done


def run_here(folder: Path, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Run ``cylinder-friction`` in a folder like ``run``, but in this process, which spares seconds of imports."""
    program, *words = command
    assert program == "cylinder-friction"
    # MLflow remembers by a model's id where its files are; copies of a store have the same ids, but other files.
    mlflow_stores._artifact_repos_cache.clear()
    out, err = io.StringIO(), io.StringIO()
    with chdir(folder), patch.dict(os.environ, environment(), clear=True), redirect_stdout(out), redirect_stderr(err):
        status = main(words)
    if check:
        assert status == 0, f"{' '.join(command)}\n{out.getvalue()}\n{err.getvalue()}"
    return subprocess.CompletedProcess(command, status, out.getvalue(), err.getvalue())


def commit(folder: Path, message: str) -> None:
    """Commits everything under a neutral name."""
    run(folder, "git", "add", "--all")
    who = ("-c", "user.name=test", "-c", "user.email=test@localhost")
    run(folder, "git", *who, "commit", "--quiet", "--message", message)


def new_repository(folder: Path) -> Path:
    """Copy what git holds or would hold into ``folder``, as a repository with one commit and the smoke recipe."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in listed.stdout.splitlines():
        if (PROJECT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(PROJECT / name, folder / name)
    for lock in ("dvc.lock", "benchmark/dvc.lock"):
        (folder / lock).unlink(missing_ok=True)
    run(folder, "git", "init", "--quiet")
    run_here(folder, "cylinder-friction", "params", "experiment=smoke")
    commit(folder, "smoke")
    return folder


def copy_of(pipeline: Path, parent: Path) -> Path:
    """Return a copy of a finished pipeline's repository, its data, cache and store included."""
    return copied(pipeline, parent / "project")
