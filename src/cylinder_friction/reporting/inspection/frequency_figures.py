"""Spectra of the signals with their noise levels, and gain and delay of the filters over frequency."""

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.inspection.filter_costs import FilterCost
from cylinder_friction.evaluation.inspection.spectra import Spectrum
from cylinder_friction.reporting.page import PageFigure
from cylinder_friction.reporting.style import BLUE, INK, ORANGE, PINK, QUIET, SERIES

SPECTRUM_POINTS = 250
MS_PER_S = 1e3
MM_PER_M = 1e3
PA_PER_BAR = 1e5


SIGNALS = {
    "pressure_1_pa": ("pressure [bar/√Hz]", "P1, piston side", ORANGE, 1.0 / PA_PER_BAR),
    "pressure_2_pa": ("pressure [bar/√Hz]", "P2, rod side", BLUE, 1.0 / PA_PER_BAR),
    "drive_force_n": ("force [N/√Hz]", "drive force", QUIET, 1.0),
    "position_m": ("position [mm/√Hz]", "position", INK, MM_PER_M),
    "raw_velocity_m_s": ("velocity [mm/s/√Hz]", "velocity, differences of raw position", QUIET, MM_PER_M),
    "velocity_m_s": ("velocity [mm/s/√Hz]", "velocity, filtered", BLUE, MM_PER_M),
}
"""Panel, words and colour of each signal, and the factor from its unit to the shown one."""


def spectra(found: Mapping[str, Spectrum], cost: FilterCost | None) -> PageFigure:
    """Draw the amplitude densities of pressures or drive force, position and velocity.

    The spectra come from ``signal_spectra``. If ``cost`` is known, the cut-offs of the filter in use are marked.
    """
    panels = [(axis, list(names)) for axis, names in itertools.groupby(found, key=lambda name: SIGNALS[name][0])]
    figure = PageFigure([1.0] * len(panels), 0.11)
    for column, (axis, names) in enumerate(panels, start=1):
        cut_off_hz = math.inf
        if cost is not None:
            cut_off_hz = cost.pressure_bandwidth_hz if column == 1 else cost.velocity_bandwidth_hz
        _panel(figure, column, {name: found[name] for name in names}, cut_off_hz)
        figure.y_axis(column, axis, type="log", exponentformat="power", dtick=1)
        figure.x_axis(column, "frequency [Hz]", type="log", dtick=1)
    return figure.look(430, legend_rows=2)


def _panel(figure: PageFigure, column: int, signals: Mapping[str, Spectrum], cut_off_hz: float) -> None:
    lowest, highest = math.inf, 0.0
    for signal, found in signals.items():
        _, name, colour, units = SIGNALS[signal]
        has_noise = "velocity" not in signal  # No sensor measures velocity
        rows = log_spaced(len(found.frequency_hz))
        frequency, density = found.frequency_hz[rows], np.maximum(units * found.density[rows], 1e-12)
        lowest, highest = min(lowest, float(np.min(density))), max(highest, float(np.max(density)))
        _add(figure, column, name, frequency, density, {"color": colour, "width": 1.3})
        ends = frequency[[0, -1]]
        if has_noise and found.noise > 0.0:
            noise = np.full(2, units * found.noise)
            _add(figure, column, "sensor's noise", ends, noise, {"color": colour, "dash": "dash"})
        if has_noise and math.isfinite(found.converter_noise):
            step = np.full(2, units * found.converter_noise)
            _add(figure, column, "converter's step alone", ends, step, {"color": colour, "dash": "dot"})
    if math.isfinite(cut_off_hz):
        _add(
            figure,
            column,
            "filter in use, -3 dB",
            np.full(2, cut_off_hz),
            np.array([lowest, highest]),
            {"color": PINK, "width": 2},
        )


def _add(figure: PageFigure, column: int, name: str, x: Array, y: Array, line: dict[str, object]) -> None:
    hover = f"%{{x:.3~g}} Hz, %{{y:.3~g}}<extra>{name}</extra>"
    shown = {"mode": "lines", "name": name, "legendgroup": name, "line": line, "hovertemplate": hover}
    figure.add(column, x=x, y=y, showlegend=not figure.shows(name), **shown)


def log_spaced(count: int) -> NDArray[np.intp]:
    """Choose at most ``SPECTRUM_POINTS`` of ``count`` rows, evenly spaced on a log scale."""
    rows = np.geomspace(1, count, min(count, SPECTRUM_POINTS)).round().astype(np.intp) - 1
    return np.unique(rows)


def filter_figure(costs: Sequence[FilterCost]) -> PageFigure:
    """Draw each filter's gain and delay for velocity over frequency."""
    titles = "velocity out over velocity in", "how late velocity comes out"
    figure = PageFigure((1.0, 1.0), 0.09, titles=titles)
    for cost, colour in zip(costs, itertools.cycle(SERIES)):
        line = {"color": colour, "width": 2, "dash": "solid" if cost.causal else "dot"}
        name = f"{cost.name} ({'real time' if cost.causal else 'off line'})"
        for column, values in ((1, cost.velocity_gain), (2, MS_PER_S * cost.velocity_lag_s)):
            _add(figure, column, name, cost.frequency_hz, values, line)
    for panel in (1, 2):
        figure.x_axis(panel, "frequency [Hz]", type="log", dtick=1)
    figure.y_axis(1, "gain", rangemode="tozero")
    figure.y_axis(2, "lag [ms]")
    return figure.look(460, legend_rows=2)
