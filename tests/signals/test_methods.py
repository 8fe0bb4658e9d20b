from typing import Any

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.methods import filters_by_method, warn_of_rates, windows_at
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.zero_phase import AdaptiveWindow, CentredMovingAverage, SavitzkyGolay, default_filter


def test_every_method_has_its_filter(cylinder: Cylinder) -> None:
    areas = (cylinder.piston_area_m2, cylinder.annulus_area_m2)
    filters = filters_by_method(
        cylinder, {"longest_s": 0.1}, {"window": 4}, {"velocity_window_s": 0.04}, {"pressure_time_s": 1.0}
    )
    assert filters == {
        "adaptive": AdaptiveWindow(*areas, longest_s=0.1, derivatives=SavitzkyGolay(velocity_window_s=0.04)),
        "moving_average": MovingAverage(4),
        "moving_average_centred": CentredMovingAverage(4),
        "savitzky_golay": SavitzkyGolay(velocity_window_s=0.04),
        "rts": RtsSmoother(pressure_time_s=1.0),
    }
    assert default_filter(cylinder) == AdaptiveWindow(*areas)


SHIPPED: dict[str, dict[str, Any]] = {"adaptive": {}, "moving_average": {}, "savitzky_golay": {}, "rts": {}}


def test_windows_in_samples_at_another_rate_are_said_in_seconds(cylinder: Cylinder) -> None:
    filters = filters_by_method(cylinder, **SHIPPED)
    assert windows_at(filters["moving_average"], 0.001) == windows_at(filters["moving_average_centred"], 0.001)
    assert windows_at(filters["moving_average"], 0.001, in_pipeline=True) == (
        "filter windows are in samples and were chosen for 200 Hz, but recordings come at 1000 Hz: window 10 lasts "
        "0.01 s in place of 0.05 s, acceleration_window 30 lasts 0.03 s in place of 0.15 s; bring them to 200 Hz "
        "with ingest.time.rate_hz=200, or keep the times with filter.moving_average.window=50 "
        "filter.moving_average.acceleration_window=150"
    )
    late = filters["moving_average"]
    assert windows_at(late, 0.001).endswith("bring them to 200 Hz with time.rate_hz: 200 in the mapping")
    for name in ("adaptive", "savitzky_golay", "rts"):
        assert windows_at(filters[name], 0.001) == "", "its times are in seconds"
    for each in filters.values():
        assert windows_at(each, 0.005) == windows_at(each, 1.0 / 210.0) == ""
    assert windows_at(MovingAverage(50, 150), 0.001) == "", "chosen for this rate"
    with pytest.warns(UserWarning, match=r"come at (100|500) Hz") as warned:
        warn_of_rates(late, [0.01, 0.002, 0.01, 0.005])
    assert [str(each.message).count(" Hz: ") for each in warned] == [1, 1], "each rate once"
