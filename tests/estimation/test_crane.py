"""A loader crane's exports as its logger wrote them: read by one command, friction compared at equal conditions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.from_logs import estimate_logs
from cylinder_friction.estimation.results import FrictionOfLogs
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.labelling.label import label, position_load
from cylinder_friction.recordings.columns import OTHER_POSITIONS, SAMPLE_COLUMNS
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction.recordings.storage import read_recording

CONFIGURATION = Path(__file__).parents[2] / "conf"
CHANNELS = CONFIGURATION / "ingest/crane.yaml"
JIB = Cylinder(**yaml.safe_load((CONFIGURATION / "cylinder/hmf_2020k_jib.yaml").read_text()))
CRANE = Path(__file__).parents[2] / "../shared/data/crane/scope"
QUIET = ("JibSTDTest2_270325", "JibValveResponseTime_010425")
NOISY = CRANE / "JibSineTest_230425.csv.gz"
pytestmark = [
    pytest.mark.extended,
    pytest.mark.skipif(not CRANE.is_dir(), reason="the recordings of a crane are not there"),
]


@pytest.fixture(scope="module")
def estimated(tmp_path_factory: pytest.TempPathFactory) -> FrictionOfLogs:
    return estimate_logs(CRANE, JIB, tmp_path_factory.mktemp("crane") / "friction", channels=CHANNELS)


def test_all_exports_are_read(estimated: FrictionOfLogs) -> None:
    assert estimated.refused == []
    assert len(estimated.recordings) == 11
    resting = [each.name for each in estimated.recordings if each.friction_n is None]
    assert len(resting) == 3
    assert all(name.startswith("Main") for name in resting)  # the main boom moves, the jib stands
    assert {each.session for each in estimated.recordings} == {"_270325", "_010425", "_230425"}


def test_what_equal_pressures_and_speed_leave_is_stated(estimated: FrictionOfLogs) -> None:
    """23 April agrees with itself; 27 March is 0.86 kN lower, and nothing logged says why."""
    equal = {each.name: each for each in estimated.differences if each.equal is not None}
    assert len(equal) == 5
    lower = equal["JibSTDTest2_270325.csv"]
    assert lower.equal is not None
    assert -1100.0 < lower.equal.newtons < -600.0
    still = {name for name, each in equal.items() if each.is_unexplained}
    assert still == {"JibSTDTest2_270325.csv"}


@pytest.mark.filterwarnings("ignore:.*filter windows are in samples:UserWarning")
def test_bounds_from_quiet_days_hold_a_noisier_day(tmp_path: Path) -> None:
    quiet = read_recordings([CRANE / f"{name}.csv.gz" for name in QUIET], CHANNELS, JIB)
    load = position_load(quiet, JIB)
    labelled = label(quiet, JIB, load=load)
    model = LowPassForceBalanceEstimator(JIB, inputs=(*SAMPLE_COLUMNS, *OTHER_POSITIONS[:1]))
    model.position_load = load
    model.fit(labelled).calibrate(labelled, labelled, JIB)
    (found,) = estimate_logs(NOISY, JIB, tmp_path / "out", channels=CHANNELS, model=model).recordings
    assert re.match(r"pressures are 1\d.\d times as noisy .* and bounds as much wider", found.unlike_training)
    written = read_recording(tmp_path / "out" / f"{found.name}.parquet")
    label_n, usable = written.column("label_n"), written.usable()
    held = (written.column("lower_n") <= label_n) & (label_n <= written.column("upper_n"))
    steps = model.real_time().run(written.samples(model.inputs))[0]
    held_alone = (steps[:, 1] <= label_n) & (label_n <= steps[:, 2])
    assert held_alone[usable].mean() < 0.2
    assert 0.85 < held[usable].mean() < 0.95
