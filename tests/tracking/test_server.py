"""Everything over HTTP: a tracking server of one's own in place of the repository's SQLite, also for two machines."""

import multiprocessing
import os
import shutil
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import wait
from pathlib import Path
from threading import Barrier, Thread

import numpy as np
import pytest
from mlflow import MlflowClient

from candidates import NAME, other_model, race, register_together, registered_in, versions
from cylinder_friction.dvc_hashes import dvc_hash
from cylinder_friction.run_record import Dataset
from cylinder_friction.tracking.lineage import lineage
from cylinder_friction.tracking.log_run import log_datasets
from cylinder_friction.tracking.registry import track
from team_servers import postgresql_programs, server_on

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
    assert track(pipeline).logged == ["record", "search", "train", "compare"]
    assert track(pipeline).present == ["record", "search", "train", "compare"]
    first = registered_in(pipeline)
    assert first.promote
    assert registered_in(pipeline) == first
    found = lineage("models:/friction-estimator@champion", pipeline)
    assert found.holds, found.text()
    assert not (pipeline / "mlartifacts").exists(), "nothing goes to the local store"
    assert os.environ["MLFLOW_TRACKING_URI"] == server, "the environment is as it was"


def test_machines_that_log_the_same_new_datasets_at_once_all_succeed(server: str) -> None:
    client, machines = MlflowClient(server), 4
    experiment, together = client.create_experiment("datasets"), Barrier(machines)

    def log(number: int) -> int:
        run_id = client.create_run(experiment).info.run_id
        together.wait()
        log_datasets(client, run_id, {"train": Dataset("data/processed/train", f"{number:032x}", {}, 1)})
        return len(client.get_run(run_id).inputs.dataset_inputs)

    with ThreadPoolExecutor(machines) as pool:
        logged = [[*pool.map(log, [number] * machines)] for number in range(ROUNDS)]
    assert logged == [[1] * machines] * ROUNDS


ROUNDS = 20


def test_two_clones_that_race_agree_on_the_better_model(server: str, pipeline: Path, tmp_path: Path) -> None:
    spawn, errors_of = multiprocessing.get_context("spawn"), dict[str, dict[str, float]]()
    clones: tuple[list[Path], list[Path]] = ([], [])
    for number in range(ROUNDS):
        for who, roots in enumerate(clones):
            other_model(pipeline)
            roots.append(Path(shutil.copytree(pipeline, tmp_path / f"{number}-{who}")))
            percent = 9.0 - 0.2 * number - 0.1 * ((number + who) % 2)  # now the one, now the other is better
            errors_of[dvc_hash(pipeline / "models/hybrid")] = {"1": percent, "2": percent}
    barrier = spawn.Barrier(3)
    machines = [spawn.Process(target=race, args=(roots, errors_of, barrier), daemon=True) for roots in clones]
    for machine in machines:
        machine.start()

    def give_up() -> None:
        wait([machine.sentinel for machine in machines])
        barrier.abort()  # else a machine that fails would be waited for without end

    Thread(target=give_up, daemon=True).start()
    client, right = MlflowClient(server), 0
    for number in range(ROUNDS):
        barrier.wait()
        barrier.wait()  # as long as both work, however slow they are
        champion = client.get_model_version_by_alias(NAME, "champion")
        best = min(errors["1"] for errors in [*errors_of.values()][: 2 * number + 2])
        right += errors_of[champion.tags["hash_model"]]["1"] == best
        barrier.wait()
    for machine in machines:
        machine.join()
    sys.stdout.write(f"equal champion decisions of two clones on one server: {right} of {ROUNDS}\n")
    assert right == ROUNDS
    assert {each.tags["decision"] for each in versions(pipeline)} <= {"promoted", "refused"}


@pytest.mark.skipif(postgresql_programs() is None, reason="PostgreSQL is not installed")
def test_two_machines_promote_on_postgresql_while_one_is_killed(
    pipeline: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spawn, moments = multiprocessing.get_context("spawn"), np.random.default_rng(1)
    server_folder = tmp_path / "server"
    server_folder.mkdir()
    with server_on("postgresql", server_folder) as url:
        monkeypatch.setenv("MLFLOW_TRACKING_URI", url)
        registered_in(pipeline, {"1": 9.0, "2": 9.0})
        errors_of = {dvc_hash(pipeline / "models/hybrid"): {"1": 9.0, "2": 9.0}}
        for number, killed_first in enumerate((0, 1, 1)):
            clones = []
            for better in (False, True):
                other_model(pipeline)
                clones.append(shutil.copytree(pipeline, tmp_path / f"{number}{better}"))
                percent = 8.0 - number - 0.5 * better
                errors_of[dvc_hash(pipeline / "models/hybrid")] = {"1": percent, "2": percent}
            barrier, alone = spawn.Barrier(3), spawn.Barrier(1)
            machines = [spawn.Process(target=register_together, args=(each, errors_of, barrier)) for each in clones]
            for machine in machines:
                machine.start()
            barrier.wait()
            machines[killed_first].join(3.0 * moments.random())
            machines[killed_first].kill()
            again = spawn.Process(target=register_together, args=(clones[killed_first], errors_of, alone))
            again.start()
            for machine in (again, machines[1 - killed_first]):
                machine.join()
                assert machine.exitcode == 0
            champion = MlflowClient(url).get_model_version_by_alias(NAME, "champion")
            assert errors_of[champion.tags["hash_model"]] == {"1": 7.5 - number, "2": 7.5 - number}
            assert {one.tags["decision"] for one in versions(pipeline)} <= {"promoted", "refused"}
            assert len(versions(pipeline)) == 3 + 2 * number
