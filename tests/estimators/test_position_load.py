"""An estimator that knows a load by position: what it takes off, where the load is unknown, and another load."""

from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.recording import Recording

LOAD = PositionLoad(0.11, 0.14, np.array([-700.0, 300.0, 1500.0]), np.full(3, 6.0))
HEAVIER = PositionLoad(0.10, 0.13, np.array([900.0, 2500.0]), np.full(2, 9.0))


def carrying(recording: Recording, cylinder: Cylinder, load: PositionLoad) -> Recording:
    load_pa = load.at(recording.column("position_m")) / cylinder.piston_area_m2
    return recording.with_columns(pressure_1_pa=recording.column("pressure_1_pa") + load_pa)


@pytest.mark.parametrize("name", ["force_balance_unfiltered", "force_balance_paper", "force_balance_low_pass", "ridge"])
def test_friction_with_the_load_is_friction_without(
    name: str, cylinder: Cylinder, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    recordings = labelled_recordings[:3]
    bare = baselines(cylinder)[name].fit(recordings)
    loaded = [carrying(each, cylinder, LOAD) for each in recordings]
    knows = baselines(cylinder, position_load=LOAD)[name].fit(loaded)
    usable, label_n = recordings[0].usable(), recordings[0].column("friction_n")
    error_n, bare_n = (
        np.abs(estimator.estimate(recording) - label_n)[usable].mean()
        for estimator, recording in ((knows, loaded[0]), (bare, recordings[0]))
    )
    assert error_n < bare_n + 10.0  # the load moves by up to 25 N a millimetre, the position is not exact
    knows.save(tmp_path)
    np.testing.assert_array_equal(load_estimator(tmp_path).estimate(loaded[0]), knows.estimate(loaded[0]))
    heavier = carrying(recordings[0], cylinder, HEAVIER)
    changed = knows.with_position_load(HEAVIER).estimate(heavier)
    assert np.abs(changed - label_n)[usable].mean() < bare_n + 40.0
    assert np.abs(knows.estimate(heavier) - label_n)[usable].mean() > 500.0


def test_without_a_load_by_position_none_can_take_its_place(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    bare = baselines(cylinder)["ridge"].fit(labelled_recordings[:1])
    with pytest.raises(ValueError, match="ridge: knows no load that position decides, so that none can take its place"):
        bare.with_position_load(LOAD)
