import numpy as np

from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.mapping.channel_mapping import SensorScale
from cylinder_friction.recordings.recording import RecordingMetadata


def test_a_loss_at_one_speed_grows_with_the_square_but_for_its_laminar_part() -> None:
    speeds = np.array([-0.25, 0.0, 0.125, 0.25])
    np.testing.assert_allclose(LineLoss(3.0, 0.25).lost_pa(speeds), [-3e5, 0.0, 0.75e5, 3e5])
    half = LineLoss(3.0, 0.25, laminar_percent=50.0).lost_pa(speeds)
    np.testing.assert_allclose(half, [-3e5, 0.0, 1.125e5, 3e5])


def test_mapping_states_it_and_metadata_keep_it() -> None:
    stated = {"range": [0, 250], "unit": "bar", "line_loss": {"bar": 3.0, "speed_m_s": 0.25}}
    assert SensorScale.from_dict(stated).line_loss == LineLoss(3.0, 0.25)
    metadata = RecordingMetadata("a", "1", "s", 0.01, line_loss={"pressure_1_pa": LineLoss(3.0, 0.25)})
    assert RecordingMetadata.from_dict(metadata.to_dict()) == metadata
    assert "line_loss" not in RecordingMetadata("a", "1", "s", 0.01).to_dict()
