"""Small logs in formats that people meet, all of one motion and friction: the right result, or a refusal that helps.

The files state nothing but what their kind states; the truth is 308.4 N in steady sliding, at most 0.1 m/s.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.from_logs import estimate_logs
from cylinder_friction.estimation.results import remarks
from cylinder_friction.recordings.storage import read_recording

LOGS = Path(__file__).parents[2] / "../shared/data/field-logs"
CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
HEAVY = replace(CYLINDER, moving_mass_kg=300.0)
TWO_RODS = replace(CYLINDER, rod_diameter_1_m=0.028)
STATED = "2026-03-14T08:15:00.000"
ROWS_200 = {"units": {"time": "200Hz"}}

pytestmark = [
    pytest.mark.extended,
    pytest.mark.skipif(not LOGS.is_dir(), reason="the small logs are not there"),
    pytest.mark.filterwarnings("ignore:no mapping was given:UserWarning"),
    pytest.mark.filterwarnings("ignore:.*filter windows are in samples:UserWarning"),
]


@pytest.mark.parametrize(
    ("file", "options", "duration_s", "start"),
    [
        ("row-counter/heavy_300kg_with_time.csv.gz", {}, 30.0, ""),
        ("row-counter/sample_and_duration.csv.gz", {}, 30.0, ""),
        ("row-counter/log.csv.gz", ROWS_200, 30.0, ""),
        ("row-counter/heavy_300kg.csv.gz", ROWS_200, 30.0, ""),
        ("ticks/filetime.csv.gz", {}, 20.0, STATED + "Z"),
        ("ticks/stopwatch.csv.gz", {}, 20.0, ""),
        ("tdms-waveform/dt0.001_Time.tdms", {}, 30.0, STATED + "Z"),
        ("tdms-waveform/dt1_Zeit.tdms", {}, 30.0, STATED + "Z"),
        ("excel-serial-days/serial.csv.gz", {}, 20.0, STATED),
        ("matlab-objects/workspace_plain_v7.mat", {}, 20.0, ""),
        ("matlab-objects/workspace_string_v7.mat", {}, 20.0, ""),
        ("matlab-objects/timetable_v73.mat", {}, 20.0, ""),
        ("header-lines/daq.csv.gz", {}, 20.0, STATED),
        ("header-lines/daq.csv.gz", {"channels": "map2.yaml"}, 20.0, STATED),
        ("header-lines/gl.csv.gz", {}, 30.0, STATED),
        ("header-lines/gl.csv.gz", {"channels": "map.yaml"}, 30.0, STATED),
        ("date-and-time/date_time.csv.gz", {}, 20.0, STATED),
        ("date-and-time/us_ampm.csv.gz", {}, 20.0, STATED),
        ("date-and-time/trend.csv.gz", {}, 20.0, STATED),
        ("date-and-time/trend.csv.gz", {"channels": "time.yaml"}, 20.0, STATED),
        ("coarse-pressures/log.csv.gz", {"channels": "map_bits.yaml"}, 20.0, ""),
        *(("percent-of-stroke/log.csv.gz", options, 20.0, "") for options in ({}, {"channels": "map.yaml"})),
        ("newest-first/grafana.csv.gz", {}, 20.0, STATED),
        ("text-cells/pico.csv.gz", {"channels": "map.yaml"}, 20.0, ""),
        *((f"text-cells/{name}.csv.gz", {}, 20.0, "") for name in ("tt", "excel_point")),
        *((file, {}, 20.0, "") for file in ("dspace/rec1_001.mat", "double-rod/log.csv.gz")),
    ],
)
def test_friction_and_start(tmp_path: Path, file: str, options: dict[str, Any], duration_s: float, start: str) -> None:
    if "channels" in options:
        options = {"channels": LOGS / Path(file).parent / options["channels"]}
    cylinder = HEAVY if "heavy" in file else TWO_RODS if "double-rod" in file else CYLINDER
    result = estimate_logs(LOGS / file, cylinder, tmp_path / "friction", **options)
    assert result.refused == []
    (entry,) = result.recordings
    recording = read_recording(tmp_path / "friction" / f"{entry.name}.parquet")
    velocity_m_s, friction_n = (recording.column(name) for name in ("velocity_m_s", "friction_n"))
    sliding = recording.usable() & (np.abs(velocity_m_s) > 0.03)
    assert np.abs(friction_n[sliding]).mean() == pytest.approx(308.4, rel=0.04 if "coarse" in file else 0.02)
    assert len(recording) * recording.sample_time_s == pytest.approx(duration_s, rel=2e-3)
    assert np.quantile(np.abs(velocity_m_s), 0.99) == pytest.approx(0.1, rel=0.03)
    assert recording.metadata.start.partition(".")[0] == start.partition(".")[0]
    assert recording.metadata.start.endswith("Z") == start.endswith("Z")


def test_a_second_rod_that_is_not_stated_is_asked_for(tmp_path: Path) -> None:
    (entry,) = estimate_logs(LOGS / "double-rod/log.csv.gz", CYLINDER, tmp_path / "friction").recordings
    words = " ".join(remarks(entry))
    assert "loss of a line, of about 558 N; map a load cell, use --load position, zero the sensors" in words
    assert "is 307 N extending and 307 N retracting (307 N at equal position): if the cylinder has a rod on" in words
