"""Everything over HTTP: a tracking server of one's own in place of the repository's SQLite, also for two machines."""

import multiprocessing
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from mlflow import MlflowClient

from candidates import NAME, other_model, register_together, registered_in, versions
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking.lineage import lineage
from cylinder_friction.tracking.replay import replay
from team_servers import server_on

pytestmark = pytest.mark.extended


@pytest.fixture
def server(pipeline: Path, tmp_path: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A server that keeps runs and artifacts to itself, as one on another machine does."""
    where = tmp_path / "server"
    where.mkdir()
    (where / "mlflow.db").write_bytes(empty_store.read_bytes())
    with server_on("sqlite", where) as url:
        monkeypatch.setenv("MLFLOW_TRACKING_URI", url)
        yield url


def test_runs_registry_and_lineage_work_over_http(server: str, pipeline: Path) -> None:
    assert replay(pipeline).logged == ("record", "search", "train", "compare")
    assert replay(pipeline).present == ("record", "search", "train", "compare")
    first = registered_in(pipeline)
    assert first.promote
    assert registered_in(pipeline) == first
    found = lineage("models:/friction-estimator@champion", pipeline)
    assert found.holds, found.text()
    assert not (pipeline / "mlartifacts").exists(), "nothing goes to the local store"
    assert os.environ["MLFLOW_TRACKING_URI"] == server, "the environment is as it was"


@pytest.mark.parametrize("roles", [("better", "worse"), ("worse", "better")])
def test_the_better_of_two_is_champion_whoever_is_first(
    roles: tuple[str, str], server: str, pipeline: Path, tmp_path: Path
) -> None:
    errors = {"incumbent": {"1": 3.0, "2": 3.0}, "worse": {"1": 2.5, "2": 2.5}, "better": {"1": 2.0, "2": 2.0}}
    spawn, clones = multiprocessing.get_context("spawn"), []
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
    champion = MlflowClient(server).get_model_version_by_alias(NAME, "champion")
    assert [machine.exitcode for machine in machines] == [0, 0]
    assert errors_of[champion.tags["model_key"]] == errors["better"]
    assert len(versions(pipeline)) == 3
