"""Work on a real Dask scheduler with two workers, on loopback."""

from __future__ import annotations

import asyncio
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from distributed import Client

import loopback_cluster as loopback
from cylinder_friction.execution import cluster as cluster_module
from cylinder_friction.execution.cluster import common_environment, environment
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.execution.workers import ONE_THREAD, VARIABLE, WorkersError
from cylinder_friction.extras import MissingExtraError
from cylinder_friction.tuning.search import SearchPlan, run_search
from cylinder_friction.tuning.space import SearchSpace
from process_work import bowl, cost, die, die_once, place, twice

MODULES = (Path(__file__).parents[1],)
TLS = "DASK_DISTRIBUTED__COMM__TLS__"
CLIENT = """
from functools import partial
from cylinder_friction.execution import cluster
from cylinder_friction.execution.selection import workers_from_environment
from process_work import twice
cluster.CONNECT_S = 20.0
with workers_from_environment() as workers:
    print(list(workers.in_order([partial(twice, n) for n in range(5)])))
"""

pytestmark = pytest.mark.extended


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with loopback.loopback_cluster(tmp_path_factory.mktemp("cluster"), modules=MODULES) as started:
        yield started


@pytest.fixture
def on_cluster(cluster: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv(VARIABLE, cluster.address)
    return cluster


@pytest.mark.parametrize("way", ["address", "file"])
def test_results_come_in_the_order_of_the_pieces(way: str, cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(getattr(cluster, way)))
    with workers_from_environment() as workers:
        assert list(workers.in_order([partial(twice, n) for n in range(50)])) == [2 * n for n in range(50)]


def test_a_piece_runs_in_the_folder_of_the_command_with_one_thread(
    on_cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with workers_from_environment() as workers:
        assert list(workers.in_order([partial(place, 0)])) == [(str(tmp_path), ["1"] * len(ONE_THREAD))]


def test_a_killed_worker_costs_nothing(on_cluster: Any, tmp_path: Path) -> None:
    pieces = [partial(die_once, str(tmp_path / "killed"), n) for n in range(20)]
    with workers_from_environment() as workers:
        assert list(workers.in_order(pieces)) == [2 * n for n in range(20)]
    assert (tmp_path / "killed").exists()


def test_a_result_whose_worker_dies_as_it_arrives_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arrived, gather = threading.Event(), Client._gather_remote

    async def slowly(*given: Any) -> Any:
        found = await gather(*given)
        arrived.set()
        while {each.status for each in given[0].futures.values()} != {"lost"}:
            await asyncio.sleep(0.01)
        return found

    monkeypatch.setattr(Client, "_gather_remote", slowly)
    with loopback.loopback_cluster(tmp_path, 1, MODULES) as cluster:
        monkeypatch.setenv(VARIABLE, cluster.address)
        killer = threading.Thread(target=lambda: (arrived.wait(30.0), cluster.kill_worker()))
        killer.start()
        with workers_from_environment() as workers:
            assert list(workers.in_order([partial(twice, 21)])) == [42]
        killer.join()


def test_a_piece_that_kills_every_worker_is_reported_by_name_and_the_others_are_done(on_cluster: Any) -> None:
    names = [f"recording {n}" for n in range(6)]
    done = []
    with workers_from_environment() as workers, pytest.raises(WorkersError) as caught:
        done.extend(workers.all_in_order([partial(die if n == 2 else twice, n) for n in range(6)], names))
    assert done == [0, 2, 6, 8, 10]
    message = str(caught.value)
    assert message.startswith("recording 2: 2 workers died of it, the last one tcp://127.0.0.1:")
    assert "with a memory limit of" in message
    assert message.endswith("GiB; it may have run out of memory; the other 5 of 6 are done")


def test_a_search_in_batches_is_the_same_on_a_cluster_whose_worker_is_killed(on_cluster: Any, tmp_path: Path) -> None:
    space = SearchSpace((1, 2, 3), (16, 32, 64), (0.1, 0.3), (1e-5, 1e-3), (32, 100), (10, 50))
    plan = SearchPlan(10, 4, 3, 200, batch=4)
    alone = run_search(space, plan, cost, partial(bowl, ""), tmp_path / "alone.log", lambda: None)
    objective = partial(bowl, str(tmp_path / "killed"))
    with workers_from_environment() as workers:
        found = run_search(space, plan, cost, objective, tmp_path / "cluster.log", lambda: None, workers)
    assert found == alone
    assert (tmp_path / "killed").exists()


def test_a_worker_of_two_threads_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with loopback.loopback_cluster(tmp_path, 0, MODULES) as cluster:
        cluster.add_worker("--nthreads", "2")
        monkeypatch.setenv(VARIABLE, cluster.address)
        with pytest.raises(WorkersError) as caught, workers_from_environment():
            pass
    assert "has threads 2 (expected 1); results would not be equal bit for bit" in str(caught.value)


def test_workers_unlike_each_other_are_refused_and_workers_unlike_this_machine_are_noted(
    capsys: pytest.CaptureFixture[str],
) -> None:
    own = environment()
    other = {**own, "processor": "zen9 1234"}
    common_environment(own, {"tcp://a:1": own, "tcp://b:1": own})
    assert capsys.readouterr().out == ""
    common_environment(own, {"tcp://a:1": other, "tcp://b:1": other})
    assert f"note: all workers have processor zen9 1234 (here {own['processor']})" in capsys.readouterr().out
    with pytest.raises(WorkersError, match=r"worker tcp://b:1 has processor zen9 1234 .expected"):
        common_environment(own, {"tcp://a:1": own, "tcp://b:1": other})
    with pytest.raises(WorkersError, match=r"worker tcp://a:1 has numpy 1.0 .expected .*start all workers with"):
        common_environment(own, {"tcp://a:1": {**own, "numpy": "1.0"}})


def test_a_cluster_without_scheduler_or_worker_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        monkeypatch.setenv(VARIABLE, f"tcp://127.0.0.1:{free.getsockname()[1]}")
    with monkeypatch.context() as impatient:
        impatient.setattr(cluster_module, "CONNECT_S", 0.5)
        with pytest.raises(WorkersError) as caught, workers_from_environment():
            pass
    assert "no Dask scheduler responds there within" in str(caught.value)
    assert "start one with `dask scheduler`, or unset CYLINDER_FRICTION_WORKERS" in str(caught.value)
    with loopback.loopback_cluster(tmp_path, 0, MODULES) as cluster:
        monkeypatch.setenv(VARIABLE, cluster.address)
        with pytest.raises(WorkersError, match="has had no worker for 0 s; start"), workers_from_environment():
            pass


def test_a_missing_library_is_named_with_the_command_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "tcp://127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, cluster_module.__name__)
    with pytest.raises(MissingExtraError, match=r'needs distributed, .*; pip install "cylinder-friction\[cluster\]"'):
        workers_from_environment()


@pytest.fixture
def certified(tmp_path: Path) -> dict[str, str]:
    """Return Dask's settings for a private authority, and one certificate of it that everybody uses."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    for made in (
        ["req", "-x509", *key, "-subj", "/CN=authority", "-keyout", "ca-key.pem", "-out", "ca.pem"],
        ["req", *key, "-subj", "/CN=loopback", "-keyout", "key.pem", "-out", "request.pem"],
        ["x509", "-req", "-in", "request.pem", "-CA", "ca.pem", "-CAkey", "ca-key.pem", "-out", "cert.pem"],
    ):
        subprocess.run(["openssl", *made], cwd=tmp_path, check=True, capture_output=True)
    files = {"CA_FILE": "ca.pem"}
    for who in ("CLIENT", "WORKER", "SCHEDULER"):
        files |= {f"{who}__CERT": "cert.pem", f"{who}__KEY": "key.pem"}
    return {f"{TLS}{name}": str(tmp_path / file) for name, file in files.items()}


def run_twice(address: str, settings: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Do five pieces on a cluster in a process of its own, for Dask reads its settings when it is imported."""
    path = os.pathsep.join(map(str, (loopback.SOURCE, *MODULES)))
    given = {**os.environ, **settings, VARIABLE: address, "PYTHONPATH": path}
    return subprocess.run([sys.executable, "-c", CLIENT], env=given, capture_output=True, text=True)


def test_over_tls_pieces_are_done_and_whoever_has_no_certificate_is_refused(
    certified: dict[str, str], tmp_path: Path
) -> None:
    with loopback.loopback_cluster(tmp_path, 1, MODULES, certified) as cluster:
        assert cluster.address.startswith("tls://127.0.0.1:")
        done = run_twice(cluster.address, certified)
        assert done.stdout == "[0, 2, 4, 6, 8]\n", done.stderr
        for settings, problem in (({}, ""), ({**certified, f"{TLS}CA_FILE": "/nowhere"}, " ([Errno 2] No such file")):
            refused = run_twice(cluster.address, settings).stderr.splitlines()[-1]
            expected = f"{cluster.address}, whose scheduler wants a certificate, and there is none{problem}"
            assert f"WorkersError: CYLINDER_FRICTION_WORKERS is {expected}" in refused
            assert refused.endswith(f"; set {TLS}CA_FILE, {TLS}CLIENT__CERT and {TLS}CLIENT__KEY to their files")
        assert "no Dask scheduler responds there" in run_twice(cluster.address.replace("tls", "tcp"), {}).stderr
