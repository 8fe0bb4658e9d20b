"""Every runtime takes the readings of the sensors, and applies the signs and offsets of the model's mapping itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contracts.runtimes import Runtime, all_runtimes, run
from contracts.tolerances import TOLERANCES_N
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.line_loss import FLOW_SIGNS, LineLoss
from cylinder_friction.signals.causal import FirFilter
from cylinder_friction.testing.golden import MODEL_FOLDER, read_trajectories
from golden_fixtures import GOLDEN

CORRECTIONS = {
    "pressure_1_pa": ChannelCorrection(offset=1.3e5),
    "pressure_2_pa": ChannelCorrection(-1, -0.4e5),
    "position_m": ChannelCorrection(-1, 0.25),
}


LINES = {
    "pressure_1_pa": LineLoss(bar=2.0, speed_m_s=0.01, laminar_percent=20.0),
    "pressure_2_pa": LineLoss(length_m=1.0, bore_mm=3.0, oil_mm2_s=3.0, area_m2=2.5e-3),
}


@pytest.mark.parametrize("runtime", all_runtimes(), ids=lambda runtime: runtime.name)
def test_it_takes_readings_and_gives_what_python_gives_for_corrected_samples(runtime: Runtime, tmp_path: Path) -> None:
    folder = GOLDEN / "learns_offset"
    model = replace(load_estimator(folder / MODEL_FOLDER).step_model(), corrections=CORRECTIONS)
    golden = read_trajectories(folder)["stick_slip_reversals"]
    readings = np.stack(
        [own.readings(values) for own, values in zip(CORRECTIONS.values(), golden.samples.T, strict=True)], axis=1
    )
    readings[900] = np.nan
    expected, expected_flags = RealTimeStream(model).run(readings)
    newtons, flags = run(runtime.open(model, tmp_path), readings)
    np.testing.assert_array_equal(flags, expected_flags)
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=TOLERANCES_N[runtime.name])
    before = slice(0, 900)
    np.testing.assert_array_equal(flags[before], golden.flags[before])
    np.testing.assert_allclose(expected[before], golden.newtons[before], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("runtime", all_runtimes(), ids=lambda runtime: runtime.name)
def test_it_subtracts_the_loss_of_lines_at_the_causal_velocity(runtime: Runtime, tmp_path: Path) -> None:
    folder = GOLDEN / "learns_offset"
    without = load_estimator(folder / MODEL_FOLDER).step_model()
    model = replace(without, corrections=CORRECTIONS, line_loss=LINES)
    samples = read_trajectories(folder)["stick_slip_reversals"].samples
    velocity_m_s = FirFilter(model.velocity_taps[None, model.position :][:, :1]).run(samples[:, model.position :])[:, 0]
    at_sensors = samples.copy()
    for place, (name, line) in enumerate(LINES.items()):
        at_sensors[:, place] += line.lost_pa(FLOW_SIGNS[name] * velocity_m_s)
    assert (np.abs(at_sensors - samples)[:, :2].max(axis=0) > 4e4).all()
    assert np.abs(velocity_m_s).max() > LINES["pressure_2_pa"].terms().turbulent_from_m_s > 0.0
    readings = np.stack(
        [own.readings(values) for own, values in zip(CORRECTIONS.values(), at_sensors.T, strict=True)], axis=1
    )
    expected, expected_flags = RealTimeStream(model).run(readings)
    newtons, flags = run(runtime.open(model, tmp_path), readings)
    np.testing.assert_array_equal(flags, expected_flags)
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=TOLERANCES_N[runtime.name])
    np.testing.assert_allclose(expected, RealTimeStream(without).run(samples)[0], rtol=0.0, atol=1e-6)
