"""Pressures, position, velocity, force and friction over time, one panel each, time axes linked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from cylinder_friction.reporting.inspection.drawing import (
    EXTENDING,
    GREEN,
    INK,
    LINE_POINTS,
    MM_PER_M,
    PA_PER_BAR,
    PISTON_SIDE,
    QUIET,
    ROD_SIDE,
    finish,
    single,
)
from cylinder_friction.reporting.inspection.thinning import extremes
from cylinder_friction.signals.smooth_signals import has_pressures

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.reporting.inspection.friction_view import FrictionView

    Array = NDArray[np.float64]

PANEL_HEIGHT = 165


@dataclass(frozen=True)
class Line:
    """One line of a panel, named in the legend."""

    name: str
    values: Array
    colour: str


@dataclass(frozen=True)
class Panel:
    """Lines that share an axis, and the axis's title with its unit."""

    axis: str
    lines: tuple[Line, ...]


def over_time(recording: Recording, view: FrictionView | None) -> go.Figure:
    """Return the figure; without a view of friction only what was measured is drawn."""
    panels = measured_panels(recording) + (calculated_panels(view) if view is not None else [])
    figure = make_subplots(rows=len(panels), cols=1, shared_xaxes=True, vertical_spacing=0.14 / len(panels))
    time_s = recording.column("time_s")
    for row, panel in enumerate(panels, start=1):
        for line in panel.lines:
            rows = extremes(line.values, LINE_POINTS)
            figure.add_trace(
                go.Scatter(
                    x=time_s[rows],
                    y=single(line.values[rows]),
                    mode="lines",
                    name=line.name,
                    line={"color": line.colour, "width": 1.2},
                    hovertemplate="%{y:.4~g}",
                ),
                row=row,
                col=1,
            )
        figure.update_yaxes(title_text=panel.axis, row=row, col=1)
    figure.update_xaxes(title_text="time [s]", row=len(panels), col=1)
    figure.update_layout(hovermode="x")
    return finish(figure, PANEL_HEIGHT * len(panels) + 110)


def measured_panels(recording: Recording) -> list[Panel]:
    """Return the panels of what sensors gave, in bar, mm, N and °C."""
    panels = []
    columns = set(recording.table.columns)
    if has_pressures(recording):
        sides = (
            Line("P1, piston side", recording.column("pressure_1_pa") / PA_PER_BAR, PISTON_SIDE),
            Line("P2, rod side", recording.column("pressure_2_pa") / PA_PER_BAR, ROD_SIDE),
        )
        panels.append(Panel("pressure [bar]", sides))
    panels.append(
        Panel("position [mm]", (Line("position, 0 retracted", MM_PER_M * recording.column("position_m"), INK),))
    )
    if "load_force_n" in columns:
        panels.append(Panel("load [N]", (Line("load force", recording.column("load_force_n"), QUIET),)))
    if "oil_temperature_c" in columns:
        panels.append(Panel("oil [°C]", (Line("oil temperature", recording.column("oil_temperature_c"), QUIET),)))
    return panels


def calculated_panels(view: FrictionView) -> list[Panel]:
    """Return the panels of velocity, driving force and friction; friction has gaps where it is not usable."""
    friction_n = np.where(view.usable, view.friction_n, np.nan)
    velocity = MM_PER_M * view.signals.velocity_m_s
    return [
        Panel("velocity [mm/s]", (Line("velocity, extending positive", velocity, EXTENDING),)),
        Panel("force [N]", (Line(view.force_name, view.force_n, QUIET),)),
        Panel("friction [N]", (Line(view.friction_name, friction_n, GREEN),)),
    ]
