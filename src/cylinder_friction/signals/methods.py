"""Every filter for whole recordings, by the name of its method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.zero_phase import CentredMovingAverage, SavitzkyGolay

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cylinder_friction.signals.smooth_signals import SignalFilter


def filters_by_method(
    moving_average: Mapping[str, Any], savitzky_golay: Mapping[str, Any], rts: Mapping[str, Any]
) -> dict[str, SignalFilter]:
    """Return the filters from the parameters of each; both moving averages share theirs."""
    return {
        "moving_average": MovingAverage(**moving_average),
        "moving_average_centred": CentredMovingAverage(**moving_average),
        "savitzky_golay": SavitzkyGolay(**savitzky_golay),
        "rts": RtsSmoother(**rts),
    }
