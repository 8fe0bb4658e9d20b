"""The dashboard and the alert rules ask the tables for what they hold, in a real PostgreSQL."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import team_servers as servers
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.fleet.database import update_database
from cylinder_friction_monitoring.fleet.entries import entries_of
from cylinder_friction_monitoring.fleet.nightly import monitor_fleet
from fleet_samples import NOW, write_fleet, write_session

GRAFANA = Path(__file__).parents[2] / "deploy/grafana"


def questions(content: Any) -> Iterator[str]:
    """Yield every SQL text of a dashboard or of alert rules, with Grafana's variables filled in."""
    if isinstance(content, dict):
        for key, value in content.items():
            if key == "rawSql" or (key == "query" and str(value).startswith("SELECT")):
                yield re.sub(r"\$__timeFilter\((\S+)\)", r"\1 IS NOT NULL", value).replace("$cylinder", "a")
            else:
                yield from questions(value)
    elif isinstance(content, list):
        for each in content:
            yield from questions(each)


ASKED = [each for path in GRAFANA.iterdir() for each in questions(yaml.safe_load(path.read_text(encoding="utf-8")))]


@pytest.mark.extended
def test_every_question_has_an_answer_in_postgresql(tmp_path: Path, labelled_recordings: list[Recording]) -> None:
    import psycopg2

    assert len(ASKED) == 13
    for day, recording in enumerate(labelled_recordings[:3], start=1):
        write_session(tmp_path / f"logs/a/2026-03-0{day}.csv", recording)
    fleet = write_fleet(tmp_path, "a", "b", own={"a": {"services": [{"time": "2026-02-01", "words": "oil"}]}})
    into = tmp_path / "health"
    health = monitor_fleet([tmp_path / "logs"], fleet, into, NOW)
    with servers.postgresql("plant") as made:
        address = made["plant"].replace("+psycopg2", "")
        entries = entries_of(into, fleet)
        assert update_database(address, into, health.lines, entries) == 2
        assert update_database(address, into, health.lines, entries) == 0
        with psycopg2.connect(address) as connection, connection.cursor() as cursor:
            rows = {}
            for question in ASKED:
                cursor.execute(question)
                rows[question] = cursor.fetchall()
            assert rows["SELECT cylinder FROM health_cylinder ORDER BY needs, cylinder"] == [("a",), ("b",)]
            assert sum("oil" in str(each) for each in rows.values()) == 2, "the service, as entry and as annotation"
        connection.close()
    with pytest.raises(MonitoringError, match=r"the tables in 127.0.0.1/plant are not up to date") as refused:
        update_database(address, into, health.lines, {})
    assert address not in str(refused.value), "an address holds a password"
