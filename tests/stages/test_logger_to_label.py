"""A logger's file as they come: two rates, a gap, sensors off by a bar. Friction must come out all the same."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.commands.params import compose_params
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.params.checking import Params, check_params
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.stages import filter as filter_stage
from cylinder_friction.stages import ingest, label
from cylinder_friction.stages._stage import LABELLED_FOLDER

nptdms = pytest.importorskip("nptdms")


CONF = Path(__file__).parents[2] / "conf"
VENTED_S, PRESSURISED_S, SECONDS = 3.0, 3.5, 30.0
GAP_S = (18.0, 18.7)
OFFSETS_BAR, SESSIONS = (1.2, -0.8), (1, 2, 3)
NOISE_BAR, NOISE_MM, STEP_BAR, STEP_MM = 0.06, 0.1, 250.0 / 4096, 250.0 / 4096

SENSOR = {"range": [0.0, 250.0], "unit": "bar", "bits": 12, "accuracy_percent": 0.5}
CHANNELS: dict[str, dict[str, Any]] = {
    "time_s": {"channel": "time", "unit": "s"},
    "pressure_1_pa": {"channel": "pA", "unit": "bar", "sensor": SENSOR},
    "pressure_2_pa": {"channel": "pB", "unit": "bar", "sensor": SENSOR},
    "position_m": {"channel": "s", "unit": "mm", "sign": -1, "offset": 260.0},
}

STEADY_MAE_N = 15.0
"""Of the label against the truth above 5 mm/s; the same sensors sampled at 200 Hz by one clock leave about 9 N."""


def position_m(time_s: Array, session: int) -> Array:
    return 0.10 + 0.04 * (1.0 - np.cos(rate(session) * np.maximum(time_s - PRESSURISED_S, 0.0)))


def velocity_m_s(time_s: Array, session: int) -> Array:
    return 0.04 * rate(session) * np.sin(rate(session) * np.maximum(time_s - PRESSURISED_S, 0.0))


def friction_n(time_s: Array, session: int) -> Array:
    velocity = velocity_m_s(time_s, session)
    return np.asarray(
        np.tanh(velocity / 2e-3) * (320.0 + 120.0 * np.exp(-((velocity / 8e-3) ** 2))) + 1500.0 * velocity
    )


def rate(session: int) -> float:
    return 0.9 + 0.2 * session


def write_log(path: Path, session: int, cylinder: Cylinder) -> None:
    """Write pressures at 1 kHz and position at 100 Hz, 37 ms later, vented for 3 s; 0.7 s of pressures are lost."""
    generator = np.random.default_rng(session)
    time_s: Array = np.arange(round(SECONDS * 1000)) * 1e-3
    working = np.clip((time_s - VENTED_S) / (PRESSURISED_S - VENTED_S), 0.0, 1.0)
    acceleration = np.gradient(velocity_m_s(time_s, session), time_s)
    second_pa = working * (9e5 + 1e5 * np.sin(0.3 * time_s))
    force_n = friction_n(time_s, session) + cylinder.moving_mass_kg * acceleration
    first_pa = (force_n + second_pa * cylinder.annulus_area_m2) / cylinder.piston_area_m2
    pressures = {
        name: sampled(pressure / 1e5 + offset, NOISE_BAR, STEP_BAR, generator)
        for name, pressure, offset in zip(("pA", "pB"), (first_pa, second_pa), OFFSETS_BAR, strict=True)
    }
    slow_s: Array = 0.037 + np.arange(round(SECONDS * 100) - 10) * 1e-2
    position = sampled(260.0 - 1e3 * position_m(slow_s, session), NOISE_MM, STEP_MM, generator)
    kept = (time_s < GAP_S[0]) | (time_s > GAP_S[1])
    path.parent.mkdir(parents=True)
    with nptdms.TdmsWriter(path) as writer:
        for name, values, unit in (
            ("time", time_s, "s"),
            ("pA", pressures["pA"], "bar"),
            ("pB", pressures["pB"], "bar"),
        ):
            writer.write_segment([nptdms.ChannelObject("fast", name, values[kept], {"unit_string": unit})])
        for name, values, unit in (("time", slow_s, "s"), ("s", position, "mm")):
            writer.write_segment([nptdms.ChannelObject("slow", name, values, {"unit_string": unit})])


def sampled(values: Array, noise: float, step: float, generator: np.random.Generator) -> Array:
    return np.asarray(np.round((values + generator.normal(0.0, noise, len(values))) / step) * step)


def params_for(zeros: bool) -> Params:
    content = compose_params(CONF, ["experiment=own", "lugre.condition=no-load", "ingest.time.rate_hz=200.0"])
    read = {"sensor": {**SENSOR, "zero_uncertainty": 0.02}}
    offsets = dict(zip(("pressure_1_pa", "pressure_2_pa"), OFFSETS_BAR, strict=True)) if zeros else {}
    stated = {name: {**CHANNELS[name], **read, "offset": offset} for name, offset in offsets.items()}
    content["ingest"] |= {"pattern": "**/*.tdms", "channels": CHANNELS | stated}
    return check_params(content, "test")


@pytest.fixture
def logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cylinder: Cylinder) -> Path:
    monkeypatch.chdir(tmp_path)
    for session in SESSIONS:
        write_log(tmp_path / f"data/raw/own/no-load_day {session}/Strökë (1) [a].tdms", session, cylinder)
    return tmp_path


def labelled(zeros: bool) -> list[Recording]:
    params = params_for(zeros)
    for stage in (ingest, filter_stage, label):
        stage.run(params)
    assert read_json(ingest.QUARANTINE_FILE) == []
    return read_stored(LABELLED_FOLDER)


def test_friction_comes_out_of_two_rates_a_gap_and_stated_offsets(logs: Path) -> None:
    recordings = labelled(zeros=True)
    assert len(recordings) == 2 * len(SESSIONS)
    for recording in recordings:
        session = int(recording.metadata.session[-1])
        assert recording.metadata.sample_time_s == 0.005
        said = "; ".join(recording.metadata.repairs)
        assert "time: split at 1 gap of more than 2 lost samples (first: 0.702 s without pressure_1_pa" in said
        assert "resampled from 1000 to 200 Hz" in said
        assert "position_m: resampled from 100 to 200 Hz" in said
        assert "lost samples interpolated" not in said
        time_s = recording.column("time_s")
        wanted = recording.usable() & (np.abs(velocity_m_s(time_s, session)) > 5e-3)
        off_n = (recording.column("friction_n") - friction_n(time_s, session))[wanted]
        assert wanted.sum() > 0.5 * len(wanted)
        assert np.abs(off_n).mean() < STEADY_MAE_N
        # A zero is common to all rows, noise is not: the mean error must lie within what is stated.
        assert abs(off_n.mean()) < recording.column("friction_uncertainty_n")[wanted].mean()


def test_offsets_that_nobody_stated_are_in_the_label_and_in_its_uncertainty(logs: Path) -> None:
    off_n, stated_n = [], []
    for recording in labelled(zeros=False):
        session = int(recording.metadata.session[-1])
        time_s, usable = recording.column("time_s"), recording.usable()
        off_n.append(float((recording.column("friction_n") - friction_n(time_s, session))[usable].mean()))
        stated_n.append(float(recording.column("friction_uncertainty_n").mean()))
    assert max(np.abs(off_n)) > 300.0
    assert np.all(np.abs(off_n) < np.array(stated_n))
