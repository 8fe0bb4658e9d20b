from __future__ import annotations

import numpy as np

from cylinder_friction.labelling.label import usable_rows
from cylinder_friction.signals.smooth_signals import Support


def test_end_stops_are_masked_as_far_as_the_filter_saw_them() -> None:
    position_m = np.full(400, 0.1)
    position_m[200] = 0.249
    usable = usable_rows(position_m, 0.25, 0.003, Support(before=30, after=20))
    expected = np.ones(400, dtype=bool)
    expected[:30] = expected[380:] = False
    # Row t looks at t - 30 to t + 20, so that it saw row 200 from 180 to 230.
    expected[180:231] = False
    np.testing.assert_array_equal(usable, expected)


def test_both_end_stops_count() -> None:
    position_m = np.array([0.1, 0.002, 0.1, 0.248, 0.1])
    assert usable_rows(position_m, 0.25, 0.003, Support(0, 0)).tolist() == [True, False, True, False, True]


def test_recording_shorter_than_the_filter_has_no_usable_row() -> None:
    assert not usable_rows(np.full(10, 0.1), 0.25, 0.003, Support(30, 30)).any()
