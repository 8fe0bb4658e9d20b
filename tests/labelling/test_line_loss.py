"""Losses between sensors and cylinder: what is stated is taken off the label, with its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest
from tests.made_recordings import made_recording

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.recording import Recording, SensorUncertainty

LINE = LineLoss(2.0, 0.05)


def lossy(recording: Recording) -> Recording:
    """Return a recording as sensors at a valve would read it."""
    lost_pa = LINE.lost_pa(recording.column("velocity_m_s"))
    p1, p2 = (recording.column(f"pressure_{side}_pa") for side in (1, 2))
    return recording.with_columns(pressure_1_pa=p1 + lost_pa, pressure_2_pa=p2 - lost_pa)


def stated(recording: Recording, line: LineLoss) -> Recording:
    sensors = {f"pressure_{side}_pa": SensorUncertainty(1e3, 0.0) for side in (1, 2)}
    lines = dict.fromkeys(sensors, line)
    return replace(recording, metadata=replace(recording.metadata, uncertainty=sensors, line_loss=lines))


def test_a_stated_loss_is_taken_off(cylinder: Cylinder) -> None:
    raw = made_recording(cylinder, seconds=30.0)
    seen = lossy(raw)
    (true,), (wrong,) = label([raw], cylinder), label([seen], cylinder)
    (right,) = label([stated(seen, LINE)], cylinder)
    rows = true.usable()

    def error(each: Recording) -> float:
        return float(np.abs(each.column("friction_n") - true.column("friction_n"))[rows].mean())

    assert error(wrong) > 200.0
    assert error(right) < 8.0


@pytest.mark.parametrize(
    ("factor", "given", "widest_n"), [(1.2, {"uncertainty_percent": 20.0}, 450.0), (0.7, {}, 900.0)]
)
def test_a_loss_stated_wrong_is_within_the_bounds(
    factor: float, given: dict[str, float], widest_n: float, cylinder: Cylinder
) -> None:
    raw = made_recording(cylinder, seconds=30.0)
    (found,) = label([stated(lossy(raw), replace(LINE, bar=factor * 2.0, **given))], cylinder)
    error_n = np.abs(found.column("friction_n") - raw.column("friction_n"))[found.usable()]
    half_n = found.column("friction_uncertainty_n")[found.usable()]
    assert np.mean(error_n <= half_n) > 0.9
    assert np.median(half_n) < widest_n


@pytest.mark.parametrize("stated_of_port", [{"bar": 0}, {"bar": 0, "speed_m_s": 0.25}])
def test_a_sensor_at_the_port_may_be_stated_and_changes_nothing(
    stated_of_port: dict[str, float], cylinder: Cylinder
) -> None:
    raw = stated(made_recording(cylinder, seconds=5.0), LineLoss(**stated_of_port))
    (found,), (plain,) = (
        label([replace(raw, metadata=each)], cylinder) for each in (raw.metadata, replace(raw.metadata, line_loss={}))
    )
    for name in ("friction_n", "friction_uncertainty_n"):
        np.testing.assert_array_equal(found.column(name), plain.column(name))
