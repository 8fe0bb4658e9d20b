import numpy as np
import pytest

from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.mapping.channel_mapping import SensorScale
from cylinder_friction.recordings.recording import RecordingMetadata

AREA_M2 = 3.117e-3


def test_a_loss_at_one_speed_grows_with_the_square_but_for_its_laminar_part() -> None:
    speeds = np.array([-0.25, 0.0, 0.125, 0.25])
    np.testing.assert_allclose(LineLoss(3.0, 0.25).lost_pa(speeds), [-3e5, 0.0, 0.75e5, 3e5])
    half = LineLoss(3.0, 0.25, laminar_percent=50.0).lost_pa(speeds)
    np.testing.assert_allclose(half, [-3e5, 0.0, 1.125e5, 3e5])


def test_a_hose_loses_as_hagen_poiseuille_and_blasius_state() -> None:
    hose = LineLoss(length_m=3.0, bore_mm=10.0, oil_mm2_s=40.0, area_m2=AREA_M2)
    flow_m3_s = 0.05 * AREA_M2
    laminar = 128.0 * 40e-6 * 870.0 * 3.0 * flow_m3_s / (np.pi * 0.01**4)
    assert hose.lost_pa(np.array([0.05]))[0] == pytest.approx(laminar, rel=1e-6)
    fast = hose.lost_pa(np.array([0.5, -0.5]))
    speed = 0.5 * AREA_M2 / (0.25 * np.pi * 0.01**2)
    reynolds = speed * 0.01 / 40e-6
    assert reynolds > 2300.0
    assert fast[0] == pytest.approx(0.316 * reynolds**-0.25 * 300.0 * 0.5 * 870.0 * speed**2, rel=1e-6)
    assert fast[1] == -fast[0]


def test_mapping_states_it_and_metadata_keep_it() -> None:
    stated = {"line_loss": {"bar": 3.0, "speed_m_s": 0.25}}
    assert SensorScale.from_dict(stated).line_loss == LineLoss(3.0, 0.25)
    metadata = RecordingMetadata("a", "1", "s", 0.01, line_loss={"pressure_1_pa": LineLoss(3.0, 0.25)})
    assert RecordingMetadata.from_dict(metadata.to_dict()) == metadata
    assert "line_loss" not in RecordingMetadata("a", "1", "s", 0.01).to_dict()
