"""Interactive panels of signals over time, one below the other, their time axes linked."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.reporting.page_figure import PageFigure, compact

LINE_POINTS = 2400
PANEL_HEIGHT = 165


@dataclass(frozen=True)
class Line:
    """One line of a panel; its name is in the legend unless ``in_legend`` is false."""

    name: str
    values: Array
    colour: str
    width: float = 1.2
    in_legend: bool = True


@dataclass(frozen=True)
class Panel:
    """Lines that share an axis, the axis's title with its unit, and the panel's share of the height."""

    axis: str
    lines: Sequence[Line]
    share: float = 1.0


def over_time(time_s: Array, panels: Sequence[Panel], legend_rows: int = 1, points: int = LINE_POINTS) -> PageFigure:
    """Draw the figure over evenly spaced times; lines of more than ``points`` samples keep only their extremes."""
    shares = [panel.share for panel in panels]
    figure = PageFigure(shares, 0.14 / len(panels), below=True)
    step_s = float(time_s[-1] - time_s[0]) / max(1, len(time_s) - 1)
    for row, panel in enumerate(panels, start=1):
        for line in panel.lines:
            values, samples = extremes(line.values, points)
            figure.add(
                row,
                x0=float(time_s[0]),
                dx=samples * step_s,
                y=compact(values),
                mode="lines",
                name=line.name,
                legendgroup=line.name,
                showlegend=line.in_legend,
                line={"color": line.colour, "width": line.width},
                hovertemplate="%{y:.4~g}",
            )
        figure.y_axis(row, panel.axis)
    figure.x_axis(len(panels), "time [s]")
    return figure.look(round(PANEL_HEIGHT * sum(shares)) + 110, legend_rows, hovermode="x")


def extremes(values: Array, points: int) -> tuple[Array, float]:
    """Find the least and the greatest value of every stretch in their order, and for how many samples each stands.

    A line through them looks like the line through all samples, with all peaks. Values that are not finite are chosen
    only in a stretch without others.

    Args:
        values: Values of shape ``(n,)``; returned unchanged if there are at most ``points``.
        points: Most values to return, at least 2.
    """
    if len(values) <= points:
        return values, 1.0
    stretch = -(-len(values) // (points // 2))
    table = np.append(values, np.full(-len(values) % stretch, np.nan)).reshape(-1, stretch)
    low = high = table
    if not (known := np.isfinite(table)).all():
        low, high = np.where(known, table, np.inf), np.where(known, table, -np.inf)
    least, greatest = np.argmin(low, axis=1), np.argmax(high, axis=1)
    both = np.stack([np.minimum(least, greatest), np.maximum(least, greatest)], axis=1)
    return table[np.arange(len(table))[:, None], both].ravel(), 0.5 * stretch


def spread_evenly(rows: NDArray[np.intp], points: int) -> NDArray[np.intp]:
    """Choose at most ``points`` of ``rows``, evenly spaced: for clouds of points, in which no row is special."""
    if len(rows) <= points:
        return rows
    return rows[np.linspace(0, len(rows) - 1, points).round().astype(np.intp)]
