"""Recordings on a Dask cluster, a worker of which is killed meanwhile: the bytes are those of the work here."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest

import loopback_cluster as loopback
from cylinder_friction.commands.params import compose_params
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.from_logs import estimate_logs
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.execution.workers import VARIABLE
from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.params.checking import Params, check_params
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.stages import filter as filter_stage
from cylinder_friction.stages import ingest, label
from logger_files import CHANNELS, write_log

pytestmark = pytest.mark.extended
CONF = Path(__file__).parents[2] / "conf"


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with loopback.loopback_cluster(tmp_path_factory.mktemp("cluster"), modules=(Path(__file__).parents[1],)) as started:
        yield started


@contextmanager
def killed_worker(cluster: Any) -> Iterator[None]:
    """Kill a worker soon after the block has begun."""
    killer = threading.Timer(0.2, cluster.kill_worker)
    killer.start()
    yield
    killer.join()


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory, labelled_recordings: list[Recording]) -> Path:
    """Four logs, a copy of one and one that cannot be read."""
    folder = tmp_path_factory.mktemp("logs")
    for recording in labelled_recordings[::2]:
        write_log(folder / f"{recording.name}.csv", recording)
    shutil.copy(folder / f"{labelled_recordings[0].name}.csv", folder / "condition1_session9.csv")
    (folder / "condition2_session9.csv").write_text("nothing", encoding="utf-8")
    return folder


def params_for(logs: Path) -> Params:
    content = compose_params(CONF, ["experiment=smoke"])
    pattern = r"(?P<session>condition(?P<condition>\d)_session\d)\.csv"
    content["ingest"] |= {"source": str(logs), "truth": str(logs), "channels": CHANNELS, "name_pattern": pattern}
    return check_params(content, "test")


def test_stages_of_recordings(cluster: Any, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    params, hashes = params_for(logs), []
    for where in ("", cluster.address):
        place = tmp_path / ((where and "cluster") or "here")
        place.mkdir()
        monkeypatch.chdir(place)
        monkeypatch.setenv(VARIABLE, where)
        with killed_worker(cluster) if where else nullcontext():
            records = [stage.run(params) for stage in (ingest, filter_stage, label)]
        hashes.append((hash_of(place / "data"), [record.metrics for record in records]))
    assert hashes[0] == hashes[1]
    assert hashes[0][1][0]["quarantined"] == 2.0


@pytest.mark.parametrize("load", ["none", "position"])
def test_estimate(
    load: Any,
    cluster: Any,
    logs: Path,
    cylinder: Cylinder,
    small_hybrid: HybridEstimator,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(VARIABLE, cluster.address)
    model = small_hybrid if load == "none" else None
    given: dict[str, Any] = {"channels": CHANNELS, "model": model, "load": load}
    hashes = []
    with workers_from_environment() as workers:
        for place, work in ((tmp_path / "here", None), (tmp_path / "cluster", workers)):
            place.mkdir()
            monkeypatch.chdir(place)
            estimate_logs(logs, cylinder, "friction", **given, workers=work)
            hashes.append(hash_of(place / "friction"))
    assert hashes[0] == hashes[1]
