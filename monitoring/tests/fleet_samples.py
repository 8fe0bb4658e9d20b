"""A small fleet: made logs in folders, the files that name them, and sessions built by hand."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import yaml

from cylinder_friction.estimation.from_logs import SUMMARY_FILE, WRITTEN_BY
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_monitoring.fleet.fleet_file import load_fleet
from cylinder_friction_monitoring.fleet.nightly import code_hash
from cylinder_friction_monitoring.fleet.one_cylinder import CylinderRun, session_file
from cylinder_friction_monitoring.fleet.plan import Fleet
from cylinder_friction_monitoring.fleet.sessions import KeptRow, key_of, write_rows
from cylinder_friction_monitoring.trends.session_row import COVARIATES, INDICATORS, Indicator, SessionRow
from logger_files import CHANNELS, write_log

NOW = datetime(2026, 6, 1, tzinfo=UTC)
DIMENSIONS = {"bore_diameter_m": 0.063, "rod_diameter_m": 0.028, "stroke_m": 0.25, "moving_mass_kg": 6.0}
START = {"zone": "UTC", "pattern": r"(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)"}


def write_fleet(folder: Path, *names: str, **content: Any) -> Fleet:
    """Write ``fleet.yaml`` and its mapping into a folder, and return the fleet."""
    own = content.pop("own", {})
    fleet = {
        "defaults": {"dimensions": DIMENSIONS, "channels": "channels.yaml"},
        "cylinders": {name: own.get(name, {}) for name in names},
        **content,
    }
    (folder / "channels.yaml").write_text(yaml.safe_dump({"channels": CHANNELS, "start": START}))
    (folder / "fleet.yaml").write_text(yaml.safe_dump(fleet))
    return load_fleet(folder / "fleet.yaml")


def write_session(path: Path, recording: Recording) -> Path:
    """Write a log that was finished long ago."""
    import os

    write_log(path, recording)
    os.utime(path, (1e9, 1e9))
    return path


def write_kept(folder: Path, fleet: Fleet, rows: Sequence[SessionRow]) -> None:
    """Write sessions of one cylinder as an earlier run keeps them."""
    name = rows[0].cylinder
    run = CylinderRun(name, fleet.cylinders[name], folder, folder, code_hash(), NOW)
    about = {"source_sha256": "", "gone": False, "source_file": "", "name": ""}
    recordings = [{**about, "session": row.session} for row in rows]
    listed = {"written_by": WRITTEN_BY, "files": [SUMMARY_FILE]}
    write_json(run.results / SUMMARY_FILE, {**listed, "recordings": recordings})
    kept = {row.session: KeptRow(row, key_of([each], run.made_by)) for row, each in zip(rows, recordings, strict=True)}
    write_rows(folder / session_file(name), rows, kept, {}, {})
    write_json(
        folder / "health.json",
        {"written_by": "cylinder-friction monitor", "files": ["health.json", session_file(name)]},
    )


def session(number: int, name: str = "a", start: str | None = None, **values: float | None) -> SessionRow:
    """Return a session that is ``number`` days after the first of 2026; ``values`` are of indicators."""
    begun = (datetime(2026, 1, 1, 6) + timedelta(days=number)).isoformat() + "Z"
    known = {"friction_n": 400.0, "half_sum_n": 20.0} | values
    return SessionRow(
        cylinder=name,
        session=f"{name}-{number:04d}",
        start=begun if start is None else start,
        start_source="file name",
        duration_s=30.0,
        indicators={each: Indicator(known.get(each), 2.0 if each in known else None, "") for each in INDICATORS},
        covariates=dict.fromkeys(COVARIATES),
        stroke={way: ((0.1, sign * 400.0), (0.2, sign * 410.0)) for way, sign in (("extend", 1.0), ("retract", -1.0))},
    )
