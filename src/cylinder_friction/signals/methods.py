"""Every filter for whole recordings, by the name of its method."""

from collections.abc import Mapping
from typing import Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.signals.adaptive import AdaptiveWindow
from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.smooth_signals import SignalFilter
from cylinder_friction.signals.zero_phase import CentredMovingAverage, SavitzkyGolay


def default_filter(cylinder: Cylinder) -> AdaptiveWindow:
    """Return the filter whose labels are nearest to true friction."""
    return AdaptiveWindow(cylinder.piston_area_m2, cylinder.annulus_area_m2)


def filters_by_method(
    cylinder: Cylinder,
    adaptive: Mapping[str, Any],
    moving_average: Mapping[str, Any],
    savitzky_golay: Mapping[str, Any],
    rts: Mapping[str, Any],
) -> dict[str, SignalFilter]:
    """Return the filters from the parameters of each; both moving averages share theirs.

    The adaptive one differentiates the position as ``savitzky_golay`` does.
    """
    polynomials = SavitzkyGolay(**savitzky_golay)
    return {
        "adaptive": AdaptiveWindow(
            cylinder.piston_area_m2, cylinder.annulus_area_m2, **adaptive, derivatives=polynomials
        ),
        "moving_average": MovingAverage(**moving_average),
        "moving_average_centred": CentredMovingAverage(**moving_average),
        "savitzky_golay": polynomials,
        "rts": RtsSmoother(**rts),
    }
