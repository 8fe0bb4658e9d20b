"""A recording's columns: checked, kept as they are, and never changed."""

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata

ABOUT = RecordingMetadata("a", "1", "s", sample_time_s=0.01)
COLUMNS = {name: np.arange(5.0) for name in ("time_s", "position_m", "pressure_1_pa", "pressure_2_pa")}
WHOLE = Recording(ABOUT, COLUMNS)


def test_what_is_derived_leaves_the_recording_as_it_was() -> None:
    more = WHOLE.with_columns(friction_n=np.ones(5))
    assert list(more.rows(slice(1, 3)).column("position_m")) == [1.0, 2.0]
    assert "friction_n" not in more.without_columns("friction_n", "never there").columns
    assert "friction_n" not in WHOLE.columns
    with pytest.raises(ValueError, match="read-only"):
        more.column("friction_n")[0] = 2.0


@pytest.mark.parametrize("values", [np.ones(3), np.ones((5, 2)), np.float64(1.0)])
def test_a_column_of_another_shape_is_refused(values: Array) -> None:
    wanted = r"^recording 'a': column 'friction_n' has shape \(.*\), expected \(5,\) as time_s; give one value for eac"
    with pytest.raises(RecordingError, match=wanted):
        Recording(ABOUT, COLUMNS | {"friction_n": values})
    with pytest.raises(RecordingError, match=wanted):
        WHOLE.with_columns(friction_n=values)


def test_a_measured_column_stays_complete_and_finite() -> None:
    bad = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    for make in (lambda: Recording(ABOUT, COLUMNS | {"position_m": bad}), lambda: WHOLE.with_columns(position_m=bad)):
        with pytest.raises(RecordingError, match=r"position_m is nan at row 2 \(1 in all\)"):
            make()
    with pytest.raises(RecordingError, match="column 'position_m' is missing; got columns"):
        WHOLE.without_columns("position_m")
