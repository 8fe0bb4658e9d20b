from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.signals.adaptive import AdaptiveWindow
from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.methods import default_filter, filters_by_method
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.zero_phase import CentredMovingAverage, SavitzkyGolay

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder


def test_every_method_has_its_filter(cylinder: Cylinder) -> None:
    areas = (cylinder.piston_area_m2, cylinder.annulus_area_m2)
    filters = filters_by_method(
        cylinder, {"longest_s": 0.1}, {"window": 4}, {"velocity_window": 9}, {"pressure_time_s": 1.0}
    )
    assert filters == {
        "adaptive": AdaptiveWindow(*areas, longest_s=0.1, derivatives=SavitzkyGolay(velocity_window=9)),
        "moving_average": MovingAverage(4),
        "moving_average_centred": CentredMovingAverage(4),
        "savitzky_golay": SavitzkyGolay(velocity_window=9),
        "rts": RtsSmoother(pressure_time_s=1.0),
    }
    assert default_filter(cylinder) == AdaptiveWindow(*areas)
