"""Figures 7 and 9, Q-Q plot and autocorrelation: what the residuals look like."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.evaluation.names import colour, title
from cylinder_friction.reporting.figures.style import panels

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from cylinder_friction.evaluation.views import Histogram

    Array = NDArray[np.float64]


def residual_histogram(name: str, counted: Histogram) -> Figure:
    """Return the histogram of one estimator's residuals with the normal curve and the quartiles."""
    figure, (axis,) = panels(1, 1, 6.2, 3.8)
    axis.bar(counted.centres_n, counted.density, width=counted.width_n, color=colour(name), alpha=0.55, linewidth=0)
    axis.plot(
        counted.centres_n, counted.normal_density, color="#000000", label="normal, same mean and standard deviation"
    )
    lower, median, upper = counted.quartiles_n
    axis.axvline(median, color="#333333", linewidth=1.4, label=f"median {median:.1f} N")
    for quartile in (lower, upper):
        axis.axvline(quartile, color="#333333", linewidth=1.0, linestyle="--")
    axis.plot([], [], color="#333333", linewidth=1.0, linestyle="--", label=f"quartiles {lower:.1f} and {upper:.1f} N")
    axis.set(
        title=f"{title(name)}: residuals in all tests",
        xlabel=f"label minus estimate [N]   ({100 * counted.outside:.1f} % lie outside)",
        ylabel="density [1/N]",
        ylim=(0.0, 1.35 * float(max(counted.density.max(), counted.normal_density.max()))),
    )
    axis.legend(loc="upper right")
    return figure


def quantile_plot(points: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Return one Q-Q panel an estimator: residual quantiles against those of a normal distribution."""
    figure, axes = panels(1, len(points), 4.2 * len(points), 3.8)
    for axis, (name, (normal, found)) in zip(axes, points.items(), strict=True):
        ends = [float(normal.min()), float(normal.max())]
        axis.plot(ends, ends, color="#000000", linewidth=1.0, label="normal")
        axis.plot(normal, found, ".", color=colour(name), markersize=4, label="residuals")
        axis.set(title=title(name), xlabel="normal quantile [N]", ylabel="residual quantile [N]")
        axis.legend()
    return figure


def autocorrelation_plot(memories: Mapping[str, tuple[Array, float]], sample_time_s: float) -> Figure:
    """Return the residuals' autocorrelation; each entry holds its values from lag 0 and the 95 % band's half width."""
    figure, axes = panels(1, len(memories), 4.6 * len(memories), 3.2)
    for axis, (name, (memory, band)) in zip(axes, memories.items(), strict=True):
        lags_ms = 1e3 * sample_time_s * np.arange(len(memory))
        axis.axhspan(-band, band, color="#BBBBBB", alpha=0.6, linewidth=0, label="independent, 95 %")
        axis.plot(lags_ms, memory, color=colour(name))
        axis.axhline(0.0, color="#000000", linewidth=0.8)
        axis.set(title=title(name), xlabel="lag [ms]", ylabel="autocorrelation of residuals", ylim=(-0.6, 1.05))
        axis.legend()
    return figure
