"""A night and ``estimate`` count the same rows when they compare a model's bounds with the label."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.friction_of_logs import estimated, label_missed
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_monitoring.trends.held_label import held_label


def test_rows_count_while_bounds_do(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    """A sensor fails for half a second. The bounds miss the label in all flagged rows, and in a quarter of the others.

    Every second row is outside the range of training, where bounds count.
    """
    ridge = RidgeEstimator().fit(labelled_recordings[:3])
    ridge.calibrate(labelled_recordings[:3], labelled_recordings[3:], cylinder)
    recording = labelled_recordings[0]
    rows, pressure_pa = np.arange(len(recording)), recording.column("pressure_1_pa").copy()
    pressure_pa[2000:2100] = 1e9  # no reading of a working sensor
    metadata = replace(recording.metadata, depends_on={"model": "one"})
    given = replace(recording.with_columns(pressure_1_pa=pressure_pa), metadata=metadata)
    found_rows = estimated(given, ridge)
    flags = found_rows.columns["flags"]
    failed = flags & (Flag.INVALID_PRESSURE_1 | Flag.RECOVERING) != 0
    trusted = flags & (Flag.NOT_READY | Flag.WARMING | Flag.INVALID_PRESSURE_1 | Flag.RECOVERING) == 0
    trusted &= flags & (Flag.FROZEN | Flag.UNMODELLED_FORCE) == 0
    label_n = np.where(trusted & (rows % 4 > 0), found_rows.column("friction_n"), 1e6)
    outside = np.where(rows % 2 > 0, Flag.OUTSIDE, 0)
    found_rows = found_rows.with_columns(label_n=label_n, flags=flags | outside)
    assert (failed & found_rows.usable()).sum() > 100
    found = held_label([found_rows], 0.9)
    assert found is not None and found.share is not None and ridge.bounds is not None  # noqa: PT018
    assert found.share == pytest.approx(0.75, abs=0.02)
    words = f"bounds hold the label in {100.0 * found.share:.0f} % of the rows, not in 90 %"
    narrow = replace(ridge.bounds, probability=0.99)  # of which a quarter is far too often missed
    assert label_missed(found_rows, narrow) == words.replace("90 %", "99 %")
