"""Two machines register at the same moment on one server: the better candidate ends as champion."""

from __future__ import annotations

import multiprocessing
import shutil
from typing import TYPE_CHECKING

import pytest
from mlflow import MlflowClient

from candidates import NAME, other_model, register_together, registered_in, versions
from cylinder_friction.recordings.files import hash_of
from team_servers import server_on

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.extended


@pytest.mark.parametrize("roles", [("better", "worse"), ("worse", "better")])
def test_the_better_of_two_is_champion_whoever_is_first(
    roles: tuple[str, str], pipeline: Path, tmp_path: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = {"incumbent": {"1": 3.0, "2": 3.0}, "worse": {"1": 2.5, "2": 2.5}, "better": {"1": 2.0, "2": 2.0}}
    (tmp_path / "server").mkdir()
    shutil.copy(empty_store, tmp_path / "server/mlflow.db")
    spawn, clones = multiprocessing.get_context("spawn"), []
    with server_on("sqlite", tmp_path / "server") as url:
        monkeypatch.setenv("MLFLOW_TRACKING_URI", url)
        registered_in(pipeline, errors["incumbent"])
        errors_of = {hash_of(pipeline / "models/hybrid"): errors["incumbent"]}
        for role in roles:
            other_model(pipeline)
            clones.append(shutil.copytree(pipeline, tmp_path / role))
            errors_of[hash_of(pipeline / "models/hybrid")] = errors[role]
        barrier = spawn.Barrier(len(clones))
        machines = [spawn.Process(target=register_together, args=(clone, errors_of, barrier)) for clone in clones]
        for machine in machines:
            machine.start()
        for machine in machines:
            machine.join()
        champion = MlflowClient(url).get_model_version_by_alias(NAME, "champion")
        assert [machine.exitcode for machine in machines] == [0, 0]
        assert errors_of[champion.tags["model_key"]] == errors["better"]
        assert len(versions(pipeline)) == 3
