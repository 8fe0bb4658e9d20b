"""Friction against velocity, the Stribeck curve, and force against position."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.inspection.friction_view import FrictionView
from cylinder_friction.evaluation.inspection.sliding_friction import WAYS, MeanFriction
from cylinder_friction.friction_models.identification.steady_points import SteadyPoint, StribeckPoint
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.reporting.inspection.frequency_figures import MM_PER_M
from cylinder_friction.reporting.page_figure import PageFigure, compact, speed_ticks
from cylinder_friction.reporting.style import BLUE, GREEN, INK, ORANGE, PALE, SERIES
from cylinder_friction.reporting.time_figure import spread_evenly

CURVE_POINTS = 200
WIDE = 200
"""Number of recordings from which their marks are small."""


def against_velocity(view: FrictionView, points: int) -> PageFigure:
    """Draw two panels: usable rows against velocity, ``points`` per direction, and steady sliding against log speed."""
    titles = "every usable row, thinned", "steady sliding, both directions"
    figure = PageFigure((0.55, 0.45), titles=titles)
    velocity = view.signals.velocity_m_s
    for name, colour, rows in ways(view):
        rows = spread_evenly(rows, points)
        figure.add(**_cloud(name, colour, MM_PER_M * velocity[rows], view.friction_n[rows]))
    _points(figure, view.points)
    if view.curve is not None:
        _curve(figure, view, view.curve)
    figure.x_axis(1, "velocity [mm/s]")
    figure.x_axis(2, "speed [mm/s]", type="log", tickvals=speed_ticks([point.velocity_m_s for point in view.points]))
    figure.y_axis(1, f"{view.friction_name} [N]")
    figure.y_axis(2, "against the motion [N]")
    return figure.look(480, legend_rows=2)


def against_position(view: FrictionView, position_m: Array, points: int) -> PageFigure:
    """Draw the force against position: its middle is load, half its width is friction."""
    figure = PageFigure()
    for name, colour, rows in ways(view):
        if name != "standstill":
            rows = spread_evenly(rows, points)
            figure.add(**_cloud(name, colour, MM_PER_M * position_m[rows], view.force_n[rows]))
    figure.x_axis(title="position [mm]")
    figure.y_axis(title=f"{view.force_name} [N]")
    return figure.look(360)


def of_files(friction: Sequence[tuple[str, Mapping[str, MeanFriction]]]) -> PageFigure | None:
    """Draw the friction of every file, by title and direction, with its interval; None for fewer than two."""
    figure = PageFigure()
    for way, (colour, symbol) in zip(WAYS, ((BLUE, "circle"), (ORANGE, "square")), strict=True):
        known = [(number, title, each[way]) for number, (title, each) in enumerate(friction, start=1) if way in each]
        figure.add(
            x=[number + (-0.1, 0.1)[way == "retracting"] for number, _, _ in known],
            y=[each.mean_n for _, _, each in known],
            error_y={"type": "data", "array": np.array([each.half_width_n for _, _, each in known]), "thickness": 1.2},
            customdata=[f"{title}: {each} N" for _, title, each in known],
            mode="markers",
            name=way,
            marker={"color": colour, "size": 8, "symbol": symbol},
            hovertemplate="%{customdata}<extra></extra>",
        )
    if max(len(trace["x"]) for trace in figure.data) < 2:
        return None
    count = len(friction)
    figure.x_axis(title="number of the file", range=[0.4, count + 0.6], tick0=1, dtick=-(-count // 12))
    figure.y_axis(title="friction against the motion [N]", rangemode="tozero")
    return figure.look(340)


def of_recordings(friction: Sequence[tuple[str, float | None]]) -> PageFigure | None:
    """Draw the friction of recordings in their order, by title [N]; None if fewer than two are known."""
    known = [(number, title, value) for number, (title, value) in enumerate(friction, start=1) if value is not None]
    if len(known) < 2:
        return None
    figure = PageFigure()
    figure.add(
        x=[number for number, _, _ in known],
        y=np.array([value for _, _, value in known]),
        customdata=[title for _, title, _ in known],
        mode="markers",
        marker={"color": GREEN, "size": 7 if len(known) < WIDE else 4},
        hovertemplate="%{customdata}: %{y:.4~g} N<extra></extra>",
    )
    figure.x_axis(title="number of the recording", range=[0.4, len(friction) + 0.6])
    figure.y_axis(title="friction [N]", rangemode="tozero")
    return figure.look(300, legend_rows=0, hovermode="closest", showlegend=False)


def compared(recordings: Mapping[str, Sequence[SteadyPoint]]) -> PageFigure | None:
    """Draw friction in steady sliding against velocity, one line per recording; None for fewer than two."""
    figure = PageFigure()
    for number, (title, found) in enumerate(recordings.items()):
        points = sorted(found, key=lambda point: point.velocity_m_s)
        if not points:
            continue
        velocity, friction = (
            np.array([getattr(point, key) for point in points]) for key in ("velocity_m_s", "friction_n")
        )
        middle = int(np.searchsorted(velocity, 0.0))  # no line between the directions, as nothing was seen there
        figure.add(
            x=np.insert(MM_PER_M * velocity, middle, 0.0),
            y=np.insert(friction, middle, np.nan),
            mode="lines+markers",
            name=title,
            line={"color": SERIES[number % len(SERIES)], "width": 1.2},
            marker={"size": 5},
            hovertemplate="%{x:.3~g} mm/s, %{y:.4~g} N",
        )
    if len(figure.data) < 2:
        return None
    figure.x_axis(title="velocity [mm/s]")
    figure.y_axis(title="friction in steady sliding [N]")
    return figure.look(420, legend_rows=0, hovermode="closest", showlegend=False)


def ways(view: FrictionView) -> list[tuple[str, str, NDArray[np.intp]]]:
    """List name, colour and usable rows of standstill, extension and retraction."""
    ways = (("standstill", PALE, 0.0), ("extending", BLUE, 1.0), ("retracting", ORANGE, -1.0))
    return [(name, colour, np.flatnonzero(view.usable & (view.direction == sign))) for name, colour, sign in ways]


def _cloud(name: str, colour: str, x: Array, y: Array) -> dict[str, Any]:
    return {
        "x": compact(x),
        "y": compact(y),
        "mode": "markers",
        "name": name,
        "legendgroup": name,
        "marker": {"color": colour, "size": 3, "opacity": 0.35},
        "hovertemplate": "%{x:.4~g}, %{y:.4~g} N<extra>" + name + "</extra>",
    }


def _curve(figure: PageFigure, view: FrictionView, curve: StribeckCurve) -> None:
    """Add the curve to both panels, over the range of speeds that were seen."""
    for way, dash in ((1.0, "solid"), (-1.0, "dash")):
        speeds = [abs(point.velocity_m_s) for point in view.points if point.velocity_m_s * way > 0.0]
        if not speeds:
            continue
        seen = np.geomspace(min(speeds), max(speeds), CURVE_POINTS)
        friction = curve.friction(way * seen)
        name, line = "Stribeck curve", {"color": INK, "width": 2}
        both: dict[str, Any] = {"mode": "lines", "name": name, "legendgroup": name, "hoverinfo": "skip"}
        x, known = MM_PER_M * seen, figure.shows(name)
        figure.add(1, x=way * x, y=friction, showlegend=not known, line=line, **both)
        figure.add(2, x=x, y=way * friction, showlegend=False, line=line | {"dash": dash}, **both)


def _points(figure: PageFigure, points: tuple[StribeckPoint, ...]) -> None:
    """Add the steady points with their intervals to both panels."""
    for way, colour, symbol in ((1.0, BLUE, "circle"), (-1.0, ORANGE, "square")):
        chosen = [point for point in points if point.velocity_m_s * way > 0.0]
        if not chosen:
            continue
        velocity = MM_PER_M * np.array([point.velocity_m_s for point in chosen])
        middle = np.array([point.friction_n for point in chosen])
        half_n = [point.known_half_width_n for point in chosen]
        rows = [point.rows for point in chosen]
        name = "steady sliding (median, 95 % interval): " + ("extending" if way > 0.0 else "retracting")
        for column, (x, y) in enumerate(((velocity, middle), (way * velocity, way * middle)), start=1):
            figure.add(
                column,
                x=x,
                y=y,
                error_y={"type": "data", "array": half_n, "thickness": 1.2},
                customdata=rows,
                mode="markers",
                name=name,
                legendgroup=name,
                showlegend=column == 1,
                marker={"color": colour, "size": 9, "symbol": symbol, "line": {"color": INK, "width": 1}},
                hovertemplate="%{x:.4~g} mm/s, %{y:.4~g} N<br>%{customdata} rows<extra></extra>",
            )
