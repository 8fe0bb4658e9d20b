"""A fleet in MLflow: a run per cylinder, a step per session, baselines as an artifact, nothing twice."""

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from cylinder_friction.recordings.recording import Recording
from cylinder_friction.tracking.store import open_store
from cylinder_friction_monitoring.fleet.files import session_file, state_file
from cylinder_friction_monitoring.fleet.nightly import monitor_fleet
from cylinder_friction_monitoring.tracking import track_health
from fleet_samples import NOW, write_fleet, write_session


def track(root: Path) -> int:
    """Run a night and log it; return how many runs changed."""
    into = root / "health"
    lines = monitor_fleet([root / "logs"], write_fleet(root, "a", "b"), into, NOW).lines
    names = [(each.cylinder, each.state) for each in lines]
    return track_health(root, [(one, state, into / session_file(one), into / state_file(one)) for one, state in names])


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty repository."""
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    (tmp_path / ".dvc").mkdir()
    return tmp_path


def test_a_session_is_a_step_and_is_logged_once(root: Path, labelled_recordings: list[Recording]) -> None:
    for day in (1, 3):
        write_session(root / f"logs/a/2026-03-0{day}.csv", labelled_recordings[day])
    write_session(root / "logs/b/2026-03-01.csv", labelled_recordings[4])
    assert track(root) == 2
    assert track(root) == 0
    write_session(root / "logs/a/2026-03-02.csv", labelled_recordings[2])  # late
    assert track(root) == 1
    with open_store(root) as store:
        runs = {run.info.run_name: run for run in store.client.search_runs([store.experiment("health")])}
        assert sorted(runs) == ["a", "b"]
        history = store.client.get_metric_history(runs["a"].info.run_id, "friction_n")
        days = sorted(datetime.fromtimestamp(each.step, UTC).day for each in history)
        assert days == [1, 2, 3]
        assert {each.timestamp for each in history} == {1000 * each.step for each in history}
        assert (runs["a"].data.tags["answer"], runs["a"].info.status) == ("not yet", "FINISHED")
        path = store.client.download_artifacts(runs["a"].info.run_id, "baselines.json")
        assert "friction_n" in json.loads(Path(path).read_text())
