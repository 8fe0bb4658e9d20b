"""Everything over HTTP: a tracking server of one's own in place of the repository's SQLite."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from candidates import registered_in
from cylinder_friction.tracking.lineage import lineage
from cylinder_friction.tracking.replay import replay
from team_servers import server_on

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

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
