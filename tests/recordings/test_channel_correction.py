"""The correction of a channel turns its reading, in the column's unit and gauge, into the column's value."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.mapping.channel_mapping import (
    STANDARD_ATMOSPHERE_PA,
    ChannelMapping,
    channel_corrections,
)
from cylinder_friction.recordings.recording import Recording, RecordingMetadata

RAW = np.array([0.7, 1.9, 55.0])


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("unit", "scale", "atmosphere"), [("bar", 1e5, 0.0), ("bara", 1e5, STANDARD_ATMOSPHERE_PA), ("psi", 6894.757, 0.0)]
)
def test_it_gives_what_ingest_makes_of_a_channel(unit: str, scale: float, atmosphere: float, sign: int) -> None:
    source = ChannelMapping("p", unit, sign=sign, offset=1.3)
    reading_pa = scale * RAW - atmosphere
    correction = source.correction("pressure_1_pa")
    values_pa = source.column_values(RAW, "pressure_1_pa")
    np.testing.assert_allclose(correction.corrected(reading_pa), values_pa, rtol=1e-6)
    np.testing.assert_allclose(correction.readings(values_pa), reading_pa, rtol=1e-6)


def test_a_column_without_sign_and_offset_has_none() -> None:
    mapping = {"time_s": ChannelMapping("t", "s", offset=3.0), "position_m": ChannelMapping("x", "mm", offset=12.0)}
    mapping |= {"pressure_1_pa": ChannelMapping("p", "bara")}
    assert channel_corrections(mapping) == {"position_m": ChannelCorrection(offset=0.012)}


def test_a_recording_gives_its_readings_back_also_after_it_was_stored(labelled_recordings: list[Recording]) -> None:
    corrections = {"pressure_2_pa": ChannelCorrection(-1, 4e4)}
    metadata = replace(labelled_recordings[0].metadata, corrections=corrections)
    metadata = RecordingMetadata.from_dict(metadata.to_dict())
    assert metadata.corrections == corrections
    recording = Recording(metadata, labelled_recordings[0].columns)
    expected = recording.samples()
    expected[:, 1] = 4e4 - expected[:, 1]
    np.testing.assert_array_equal(recording.readings(), expected)
    assert "corrections" not in labelled_recordings[0].metadata.to_dict()


def test_pressures_are_stated_in_bar() -> None:
    assert ChannelCorrection(offset=1.3e5).formula("pressure_1_pa") == "pressure_1_pa = reading - 1.3 bar"
    assert ChannelCorrection(-1, -2e3).formula("pressure_2_pa") == "pressure_2_pa = -(reading + 0.02 bar)"
    assert ChannelCorrection(-1, 0.35).formula("position_m") == "position_m = -(reading - 0.35 m)"
