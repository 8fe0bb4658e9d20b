"""Signals over time, friction against velocity, the Stribeck curve with its table, and force against position."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.inspection.friction_view import FrictionView
from cylinder_friction.evaluation.inspection.sliding_friction import WAYS, MeanFriction
from cylinder_friction.friction_models.identification.steady_points import (
    SteadyPoint,
    StribeckPoint,
    is_breakaway_known,
)
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.inspection.frequency_figures import MM_PER_M, PA_PER_BAR
from cylinder_friction.reporting.page import Line, PageFigure, Panel, Table, compact, speed_ticks, spread_evenly
from cylinder_friction.reporting.style import BLUE, BROWN, GREEN, INK, ORANGE, PALE, PINK, QUIET, SKY, YELLOW
from cylinder_friction.wording import four_digits

CURVE_POINTS = 200
WIDE = 200
"""Number of recordings from which their marks are small."""
LINE_COLOURS = (GREEN, PINK, BROWN, SKY, YELLOW, INK)
"""Colours of recordings; blue and orange are the two directions."""
COLUMNS = (
    ("pressure", "P1, piston side", "pressure_1_pa", PA_PER_BAR, "bar", ORANGE),
    ("pressure", "P2, rod side", "pressure_2_pa", PA_PER_BAR, "bar", BLUE),
    ("position", "position, 0 retracted", "position_m", 1.0 / MM_PER_M, "mm", INK),
    ("force", "drive force", "drive_force_n", 1.0, "N", QUIET),
    ("load", "load force", "load_force_n", 1.0, "N", QUIET),
    ("oil", "oil temperature", "oil_temperature_c", 1.0, "°C", QUIET),
)
"""Possible signals: panel, words, column, size of a shown unit in the column's unit, shown unit, colour."""


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


def cloud_against_velocity(velocity_m_s: Array, friction_n: Array, points: int) -> PageFigure:
    """Draw ``points`` rows per direction, evenly spread; rows whose friction is NaN are left out."""
    figure, known = PageFigure(), np.isfinite(friction_n)
    for (way, sign), colour in zip(WAYS.items(), (BLUE, ORANGE), strict=True):
        rows = spread_evenly(np.flatnonzero(known & (sign * velocity_m_s > 0.0)), points)
        figure.add(**_cloud(way, colour, MM_PER_M * velocity_m_s[rows], friction_n[rows]))
    figure.x_axis(title="velocity [mm/s]")
    figure.y_axis(title="friction [N]")
    return figure.look(360)


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
    count = len(friction)
    figure.x_axis(title="number of the recording", range=[0.4, count + 0.6], tick0=1, dtick=-(-count // 12))
    figure.y_axis(title="friction [N]", rangemode="tozero")
    return figure.look(300, legend_rows=0, hovermode="closest", showlegend=False)


def compared(recordings: Mapping[str, Sequence[SteadyPoint]]) -> PageFigure | None:
    """Draw friction in steady sliding against velocity, one line per recording; None for fewer than two.

    More recordings than ``LINE_COLOURS`` have one colour and no legend.
    """
    figure, known = PageFigure(), {title: points for title, points in recordings.items() if points}
    few = len(known) <= len(LINE_COLOURS)
    for number, (title, found) in enumerate(known.items()):
        points = sorted(found, key=lambda point: point.velocity_m_s)
        velocity, friction = (
            np.array([getattr(point, key) for point in points]) for key in ("velocity_m_s", "friction_n")
        )
        middle = int(np.searchsorted(velocity, 0.0))  # no line between the directions, as nothing was seen there
        figure.add(
            x=np.insert(MM_PER_M * velocity, middle, 0.0),
            y=np.insert(friction, middle, np.nan),
            mode="lines+markers",
            name=title,
            line={"color": LINE_COLOURS[number] if few else QUIET, "width": 1.2},
            marker={"size": 5},
            hovertemplate="%{x:.3~g} mm/s, %{y:.4~g} N",
        )
    if len(known) < 2:
        return None
    figure.x_axis(title="velocity [mm/s]")
    figure.y_axis(title="friction in steady sliding [N]")
    return figure.look(420, legend_rows=2 * few, hovermode="closest", showlegend=few)


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


def measured_panels(recording: Recording) -> list[Panel]:
    """List the panels of the measured signals, in bar, mm, N and °C."""
    panels: dict[str, list[Line]] = {}
    for panel, words, column, scale, unit, colour in COLUMNS:
        if column in recording.columns:
            panels.setdefault(f"{panel} [{unit}]", []).append(Line(words, recording.column(column) / scale, colour))
    return [Panel(axis, lines) for axis, lines in panels.items()]


def calculated_panels(view: FrictionView) -> list[Panel]:
    """List the panels of velocity and friction; friction has gaps at rows that are not usable."""
    friction = Line(view.friction_name, np.where(view.usable, view.friction_n, np.nan), GREEN)
    return [velocity_panel(view.signals.velocity_m_s), Panel(f"{view.friction_name} [N]", [friction], 1.3)]


def velocity_panel(velocity_m_s: Array) -> Panel:
    return Panel("velocity [mm/s]", [Line("velocity, extending positive", MM_PER_M * velocity_m_s, BROWN)])


def stribeck_table(view: FrictionView) -> tuple[Table | None, str]:
    """Tabulate the curve's parameters and their source; without a curve the points of steady sliding, if any."""
    points, curve = view.points, view.curve
    if curve is None:
        head = ("velocity [mm/s]", f"{view.friction_name} [N]", "± [N] (95 %)", "strokes", "rows")
        table = [
            (
                f"{MM_PER_M * point.velocity_m_s:.3g}",
                four_digits(point.friction_n),
                "–" if point.known_half_width_n is None else four_digits(point.known_half_width_n),
                str(point.strokes),
                str(point.rows),
            )
            for point in points
        ]
        return Table(head, table) if points else None, ""
    speeds = [MM_PER_M * abs(point.velocity_m_s) for point in points]
    seen = (
        f"Fitted to {len(points)} points of steady sliding, {min(speeds):.2g} to {max(speeds):.3g} mm/s; "
        f"{view.unexplained_n:.0f} N (root mean square) is not explained by speed."
    )
    if not (known := is_breakaway_known(curve, points)):
        seen += " Not seen: friction that rises towards standstill, for which slower sliding is needed."
    slow = (curve.static_n, MM_PER_M * curve.stribeck_velocity_m_s, curve.stribeck_exponent)
    static, velocity, exponent = (four_digits(value) if known else "not seen" for value in slow)
    rows = [
        ("Coulomb friction, extending", "Fc", four_digits(curve.coulomb_n), "N"),
        ("Coulomb friction, retracting", "ratio · Fc", four_digits(curve.retract_ratio * curve.coulomb_n), "N"),
        ("static friction, extending", "Fs", static, "N"),
        ("Stribeck velocity", "vs", velocity, "mm/s"),
        ("Stribeck exponent", "a", exponent, "–"),
        ("viscous coefficient", "s2", four_digits(curve.viscous_n_s_m), "N·s/m"),
        ("retracting over extending", "ratio", four_digits(curve.retract_ratio), "–"),
    ]
    return Table(("parameter", "symbol", "value", "unit"), rows), seen
