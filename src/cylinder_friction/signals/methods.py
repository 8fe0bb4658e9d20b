"""All filters for whole recordings, by the name of their method."""

import warnings
from collections.abc import Iterable, Mapping
from typing import Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.smooth_signals import SignalFilter
from cylinder_friction.signals.zero_phase import AdaptiveWindow, CentredMovingAverage, SavitzkyGolay

WINDOWS_FOR_HZ = 200.0
"""Rate that the published windows in samples were chosen for."""
SAME_RATE = 0.1  # Share by which a rate may differ without changing the windows


def filters_by_method(
    cylinder: Cylinder,
    adaptive: Mapping[str, Any],
    moving_average: Mapping[str, Any],
    savitzky_golay: Mapping[str, Any],
    rts: Mapping[str, Any],
) -> dict[str, SignalFilter]:
    """Make all filters from their parameters, as ``params.yaml`` states them under ``filter``, by method.

    Use it to compare methods on the same recordings. Both moving averages share their parameters, and the adaptive
    window differentiates the position as ``savitzky_golay`` does. Impossible parameters raise ``ValueError``.
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


def warn_of_rates(signal_filter: SignalFilter, sample_times_s: Iterable[float], *, in_pipeline: bool = False) -> None:
    """Warn (``UserWarning``) once of each sample rate for which the filter's windows in samples were not chosen.

    Only the published moving averages have windows in samples; all other filters pass silently. ``in_pipeline`` decides
    whether the advice names a parameter of the pipeline or an entry of the mapping.
    """
    for sample_time_s in sorted(set(sample_times_s)):
        if text := windows_at(signal_filter, sample_time_s, in_pipeline=in_pipeline):
            warnings.warn(text, stacklevel=3)


def windows_at(signal_filter: SignalFilter, sample_time_s: float, *, in_pipeline: bool = False) -> str:
    """State how long the published windows last at another rate than theirs; empty if nothing is wrong.

    Other windows in samples are assumed to be chosen for the recordings, and other filters' windows are in seconds. The
    advice names a parameter in the pipeline, and an entry of the mapping in commands on logs.
    """
    if not isinstance(signal_filter, MovingAverage | CentredMovingAverage):
        return ""
    windows = {name: value for name, value in vars(type(signal_filter)()).items() if name.endswith("window")}
    chosen = any(getattr(signal_filter, name) != default for name, default in windows.items())
    ratio = 1.0 / (WINDOWS_FOR_HZ * sample_time_s)
    if chosen or abs(ratio - 1.0) <= SAME_RATE:
        return ""
    times = ", ".join(
        f"{name} {window} lasts {window * sample_time_s:.3g} s in place of {window / WINDOWS_FOR_HZ:.3g} s"
        for name, window in windows.items()
    )
    rate = f"time.rate_hz: {WINDOWS_FOR_HZ:g} in the mapping"
    same = " ".join(f"filter.moving_average.{name}={round(window * ratio)}" for name, window in windows.items())
    return (
        f"filter windows are in samples and were chosen for {WINDOWS_FOR_HZ:g} Hz, but recordings come at "
        f"{1.0 / sample_time_s:.4g} Hz: {times}; bring them to {WINDOWS_FOR_HZ:g} Hz with "
        + (f"ingest.time.rate_hz={WINDOWS_FOR_HZ:g}, or keep the times with {same}" if in_pipeline else rate)
    )
