import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.signals.causal_chain import MovingAverage, OneSidedSavitzkyGolay
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.smooth_signals import (
    SignalFilter,
    SmoothSignals,
    signals_of,
    smooth_columns,
    smooth_recording,
)
from cylinder_friction.signals.zero_phase import CentredMovingAverage, SavitzkyGolay

STEP_S = 0.005
FILTERS = [MovingAverage(), OneSidedSavitzkyGolay(), CentredMovingAverage(), SavitzkyGolay(), RtsSmoother()]
GENERATOR = np.random.default_rng(2)
POSITION_M = 0.1 + np.cumsum(np.cumsum(GENERATOR.normal(0.0, 1e-6, 600)))
LEVEL = np.cumsum(GENERATOR.normal(0.0, 3e3, 600)) + GENERATOR.normal(0.0, 5e3, 600)


def recording(**columns: np.ndarray) -> Recording:
    time_s = STEP_S * np.arange(600)
    table = pd.DataFrame({"time_s": time_s, "position_m": POSITION_M, **columns})
    return Recording(RecordingMetadata("made", "1", "s1", STEP_S), table)


@pytest.mark.parametrize("each", FILTERS, ids=lambda each: type(each).__name__)
def test_columns_go_into_the_table_and_come_back(each: SignalFilter) -> None:
    for columns in ({"pressure_1_pa": LEVEL, "pressure_2_pa": LEVEL}, {"drive_force_n": LEVEL}):
        raw = recording(load_force_n=0.5 * LEVEL, **columns)
        filtered = raw.with_columns(**smooth_columns(raw, each))
        expected = smooth_recording(raw, each)
        for name, values in vars(expected).items():
            np.testing.assert_array_equal(getattr(signals_of(filtered), name), values)
        load_n, level = filtered.column("load_force_smooth_n"), next(iter(vars(expected).values()))
        np.testing.assert_allclose(load_n, 0.5 * level, rtol=1e-6, atol=1e-6)


def test_pressures_come_first_where_both_were_measured() -> None:
    both = recording(pressure_1_pa=LEVEL, pressure_2_pa=LEVEL, drive_force_n=LEVEL)
    assert isinstance(smooth_recording(both, SavitzkyGolay()), SmoothSignals)
    assert "drive_force_smooth_n" not in smooth_columns(both, SavitzkyGolay())


def test_a_recording_without_smooth_signals_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"column 'drive_force_smooth_n' is missing.* run the stage that adds it"):
        signals_of(recording(drive_force_n=LEVEL))
