"""Interactive panels of signals over time, one below the other, their time axes linked."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from cylinder_friction.arrays import Array
from cylinder_friction.reporting.style import interactive

LINE_POINTS = 2400
PANEL_HEIGHT = 165


@dataclass(frozen=True)
class Line:
    """One line of a panel; its name stands in the legend unless ``in_legend`` is false."""

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


def over_time(time_s: Array, panels: Sequence[Panel], legend_rows: int = 1, points: int = LINE_POINTS) -> go.Figure:
    """Return the figure; lines of more than ``points`` samples keep their extremes alone."""
    shares = [panel.share for panel in panels]
    figure = make_subplots(
        rows=len(panels), cols=1, shared_xaxes=True, vertical_spacing=0.14 / len(panels), row_heights=shares
    )
    for row, panel in enumerate(panels, start=1):
        for line in panel.lines:
            rows = extremes(line.values, points)
            trace = go.Scatter(
                x=single(time_s[rows]),
                y=single(line.values[rows]),
                mode="lines",
                name=line.name,
                legendgroup=line.name,
                showlegend=line.in_legend,
                line={"color": line.colour, "width": line.width},
                hovertemplate="%{y:.4~g}",
            )
            figure.add_trace(trace, row=row, col=1)
        figure.update_yaxes(title_text=panel.axis, row=row, col=1)
    figure.update_xaxes(title_text="time [s]", row=len(panels), col=1)
    figure.update_layout(hovermode="x")
    return interactive(figure, round(PANEL_HEIGHT * sum(shares)) + 110, legend_rows)


def single(values: Array) -> NDArray[np.float32]:
    """Return values in single precision, which halves the page and is finer than a pixel."""
    return np.asarray(values, dtype=np.float32)


def extremes(values: Array, points: int) -> NDArray[np.intp]:
    """Return the rows of the least and the greatest value of every stretch, in order, at most ``points`` of them.

    A line through them looks like the line through all rows: no peak is lost. Values that are not finite are chosen
    only where a stretch holds nothing else.

    Args:
        values: Shape ``(n,)``.
        points: How many rows to keep, at least 2.
    """
    if len(values) <= points:
        return np.arange(len(values))
    stretch = -(-len(values) // (points // 2))
    whole = np.full(-(-len(values) // stretch) * stretch, np.nan)
    whole[: len(values)] = values
    table = whole.reshape(-1, stretch)
    known = np.isfinite(table)
    least = np.argmin(np.where(known, table, np.inf), axis=1)
    greatest = np.argmax(np.where(known, table, -np.inf), axis=1)
    starts = stretch * np.arange(len(table))
    return np.unique(np.concatenate([starts + least, starts + greatest]))


def spread_evenly(rows: NDArray[np.intp], points: int) -> NDArray[np.intp]:
    """Return at most ``points`` of ``rows``, evenly spaced: for clouds of points, where no row is special."""
    if len(rows) <= points:
        return rows
    return rows[np.linspace(0, len(rows) - 1, points).round().astype(np.intp)]
