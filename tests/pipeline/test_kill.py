"""``kill -9`` in the middle of stages, then ``dvc repro``: the result equals the undisturbed one."""

import os
import re
import shutil
import signal
import sqlite3
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import mlflow
import pytest
import yaml

from cylinder_friction.files.whole_files import hash_of
from pipeline_workspace import copy_of, environment, run

pytestmark = [pytest.mark.extended]

RESULTS = {
    "search": ("models/search",),
    "train": ("models/hybrid", "models/lstm"),
    "register": ("models/registered.json",),
}


def without_results_of_what_is_killed(folder: Path, empty_store: Path) -> None:
    """Make the stages new again: their lock entries, runs, the run cache and what they could go on from are gone."""
    lock = folder / "dvc.lock"
    content = yaml.safe_load(lock.read_text(encoding="utf-8"))
    for stage in RESULTS:
        del content["stages"][stage]
    lock.write_text(yaml.safe_dump(content), encoding="utf-8")
    for gone in (".dvc/cache/runs", ".cylinder-friction/resume", "mlartifacts"):
        shutil.rmtree(folder / gone, ignore_errors=True)
    shutil.copy(empty_store, folder / "mlflow.db")


def one_trial_is_finished(folder: Path) -> bool:
    """Return whether Optuna's journal holds a trial whose state is complete."""
    journals = (folder / ".cylinder-friction/resume").glob("search-*/trials.log")
    return any(
        '"op_code":4,' in line and '"state":1,' in line
        for path in journals
        for line in path.read_text(encoding="utf-8").splitlines()
    )


def one_epoch_is_finished(folder: Path) -> bool:
    return any((folder / ".cylinder-friction/resume").glob("train-*/checkpoint.npz"))


def the_store_has(table: str) -> Callable[[Path], bool]:
    def told(folder: Path) -> bool:
        if not (folder / "mlflow.db").is_file():
            return False
        try:
            with sqlite3.connect(f"file:{folder / 'mlflow.db'}?mode=ro", uri=True) as store:
                return store.execute(f"select count(*) from {table}").fetchone()[0] > 0
        except sqlite3.Error:
            return False

    return told


MOMENTS: tuple[tuple[str, Callable[[Path], bool]], ...] = (
    ("search", one_trial_is_finished),
    ("train", one_epoch_is_finished),
    ("register", the_store_has("logged_models")),
    ("register", the_store_has("model_versions")),
)
"""Where each ``dvc repro`` is killed; it first finishes what the one before it has left."""


def kill_when(folder: Path, stage: str, is_time: Callable[[Path], bool]) -> None:
    """Start ``dvc repro``, waits for the moment, and kills it and everything it started."""
    process = subprocess.Popen(
        ["dvc", "repro", stage],
        cwd=folder,
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + 600.0
    while not is_time(folder):
        assert process.poll() is None, f"{stage} ended before it could be killed"
        assert time.monotonic() < deadline, f"{stage} did not come so far in ten minutes"
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def test_after_kill_9_in_stage_after_stage_a_repro_ends_as_if_nothing_had_been(
    finished_pipeline: Path, empty_store: Path, tmp_path: Path
) -> None:
    folder = copy_of(finished_pipeline, tmp_path)
    without_results_of_what_is_killed(folder, empty_store)
    for stage, is_time in MOMENTS:
        kill_when(folder, stage, is_time)
    done = run(folder, "dvc", "repro")
    assert re.findall(r"Running stage '(\w+)'", done.stdout) == ["code", MOMENTS[-1][0]]
    for result in [result for results in RESULTS.values() for result in results]:
        assert hash_of(folder / result) == hash_of(finished_pipeline / result), result
    client = mlflow.MlflowClient(f"sqlite:///{folder / 'mlflow.db'}")
    versions = client.search_model_versions("name='friction-estimator-smoke'")
    assert len(versions) == 1
    assert client.get_model_version_by_alias("friction-estimator-smoke", "champion").version == versions[0].version
