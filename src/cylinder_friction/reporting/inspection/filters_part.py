"""What each filter costs, as a table and a figure."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cylinder_friction.reporting.inspection.drawing import MM_PER_M
from cylinder_friction.reporting.inspection.filter_costs import MOTION_HZ
from cylinder_friction.reporting.inspection.frequency_figures import MS_PER_S, filter_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.reporting.inspection.filter_costs import FilterCost
    from cylinder_friction.reporting.inspection.html_page import Pane


def add_filters(pane: Pane, costs: Sequence[FilterCost], left_out: Sequence[str]) -> None:
    """Add the table and the figure; filters that the recording is too short for are named below them."""
    pane.heading("What each filter costs")
    if costs:
        _table(pane, costs)
        pane.figure(
            filter_figure(costs),
            "Solid: runs in real time. Dotted: off line, looks as far ahead as back, so it is never late. Negative "
            "lag: ahead of the motion, at the cost of noise.",
        )
    told = [f"Left out: {words}." for words in left_out]
    if any(math.isnan(cost.velocity_noise_m_s) for cost in costs):
        told.append("Noise at standstill needs a second of it in all; this recording rests less.")
    pane.text(
        f"Late: slow motion, and velocity also at {MOTION_HZ:g} Hz, brisk motion of a hand or valve. Noise: root mean "
        "square of the filtered velocity, at this recording's standstill and as the position sensor's noise floor "
        f"alone would make it. {' '.join(told)}".rstrip(),
        "quiet",
    )


def _table(pane: Pane, costs: Sequence[FilterCost]) -> None:
    groups = (("", 2), ("late by [ms]", 4), ("-3 dB at [Hz]", 2), ("velocity noise [mm/s]", 2))
    head = (
        "filter",
        "use",
        "pressure",
        "velocity",
        "acceleration",
        f"velocity, {MOTION_HZ:g}\u00a0Hz",
        "pressure",
        "velocity",
        "standstill",
        "sensor",
    )
    rows = [
        (
            cost.name,
            "real\u00a0time" if cost.causal else "off\u00a0line",
            _ms(cost.pressure_delay_s),
            _ms(cost.velocity_delay_s),
            _ms(cost.acceleration_delay_s),
            _ms(cost.velocity_delay_in_motion_s),
            _hz(cost.pressure_bandwidth_hz),
            _hz(cost.velocity_bandwidth_hz),
            _noise(cost.velocity_noise_m_s),
            _noise(cost.velocity_noise_from_floor_m_s),
        )
        for cost in costs
    ]
    pane.table(head, rows, words=(0, 1), groups=groups)


def _ms(delay_s: float) -> str:
    return f"{round(MS_PER_S * delay_s, 1) + 0.0:.1f}" if math.isfinite(delay_s) else "–"


def _hz(frequency_hz: float) -> str:
    return "all" if math.isinf(frequency_hz) else f"{frequency_hz:.1f}"


def _noise(noise_m_s: float) -> str:
    return "–" if math.isnan(noise_m_s) else f"{MM_PER_M * noise_m_s:.2g}"
