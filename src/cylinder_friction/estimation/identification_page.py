"""Write the page of an identification: Stribeck curve, parameters with intervals, models compared with the label."""

from collections.abc import Mapping, Sequence

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.estimation.identified_model import (
    CONFIDENCE,
    INTERVALS,
    FrictionModels,
    IdentifiedCurve,
    IdentifiedParameter,
    half_percent,
)
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.friction_page import guess_table, offset_table
from cylinder_friction.reporting.page import (
    PLOTTED,
    Cell,
    Line,
    PageFigure,
    Panel,
    Table,
    over_time,
    page_html,
    speed_ticks,
)
from cylinder_friction.reporting.style import BLUE, GREEN, ORANGE, SERIES
from cylinder_friction.wording import four_digits

MM_PER_M = 1e3
CURVE_POINTS = 200
HEADROOM = 1.25
"""Height of the curve's figure over its greatest friction. Wide intervals of few strokes are cut off there."""
COLOURS = (ORANGE, BLUE)
TIP = "%{x:.3~g} mm/s, %{y:.4~g} N<br>strokes: %{customdata[0]}, rows: %{customdata[1]}<extra></extra>"


def identification_page(result: FrictionModels, simulated: Sequence[tuple[Recording, Mapping[str, Array]]]) -> str:
    """Make the page; equal input gives equal text.

    ``simulated`` holds every labelled recording with the friction of each identified model by title [N].
    """
    curves, models, drawn = result.curves, result.models, simulated[:PLOTTED]
    titles = [model.title for model in models if model.found is not None]
    return page_html(
        "templates/identification.html.j2",
        title="Friction models",
        percent=f"{100.0 * CONFIDENCE:g}",
        intervals=INTERVALS[0].upper() + INTERVALS[1:],
        stribeck=_stribeck_figure(curves),
        conditions=[(_named(each, curves), each, _point_table(each)) for each in curves],
        models=[(model, None if model.found is None else _parameter_table(model.parameters)) for model in models],
        errors=_error_table(simulated, titles) if titles else None,
        panes=[(f"recording-{n}", each.name, _over_time(each, lines)) for n, (each, lines) in enumerate(drawn, 1)],
        left_out=len(simulated) - len(drawn),
        offsets=offset_table(result.offsets) if result.offsets else None,
        result=result,
        guessed=None if result.guessed is None else (result.guessed["from"], guess_table(result.guessed)),
    )


def _named(curve: IdentifiedCurve, curves: Sequence[IdentifiedCurve]) -> str:
    prefix = "" if curve.condition.lower().startswith("condition") else "condition "
    return f"{prefix}{curve.condition}" if len(curves) > 1 else "all recordings"


def _stribeck_figure(curves: Sequence[IdentifiedCurve]) -> PageFigure | None:
    """Draw friction over speed, points with their intervals; None without a point."""
    figure = PageFigure()
    for number, each in enumerate(curves):
        for way, words, symbol, dash in ((1.0, "extending", "circle", "solid"), (-1.0, "retracting", "square", "dash")):
            points = [point for point in each.points if way * point.velocity_m_s > 0.0]
            if not points:
                continue
            name, colour = f"{_named(each, curves)}, {words}", SERIES[number % len(SERIES)]
            speeds = [way * point.velocity_m_s for point in points]
            figure.add(
                x=[MM_PER_M * speed for speed in speeds],
                y=[way * point.friction_n for point in points],
                error_y={"type": "data", "array": [point.known_half_width_n for point in points], "thickness": 1.2},
                customdata=[[point.strokes, point.rows] for point in points],
                mode="markers",
                name=name,
                legendgroup=name,
                marker={"color": colour, "size": 8, "symbol": symbol},
                hovertemplate=TIP,
            )
            if each.curve is not None:
                seen = np.geomspace(min(speeds), max(speeds), CURVE_POINTS)
                figure.add(
                    x=MM_PER_M * seen,
                    y=way * each.curve.friction(way * seen),
                    mode="lines",
                    line={"color": colour, "width": 1.5, "dash": dash},
                    legendgroup=name,
                    showlegend=False,
                    hoverinfo="skip",
                )
    if not figure.data:
        return None
    seen_n = [abs(own.friction_n) + (own.known_half_width_n or 0.0) for each in curves for own in each.points]
    speeds = [point.velocity_m_s for each in curves for point in each.points]
    figure.x_axis(title="speed [mm/s]", type="log", tickvals=speed_ticks(speeds))
    figure.y_axis(title="friction against the motion [N]", range=[0.0, HEADROOM * max(seen_n)])
    return figure.look(480, legend_rows=len(curves))


def _point_table(each: IdentifiedCurve) -> Table:
    rows = [
        (
            f"{MM_PER_M * point.velocity_m_s:.3g}",
            four_digits(point.friction_n),
            "–" if point.known_half_width_n is None else four_digits(point.half_width_n),
            _percent(half_percent(point)),
            f"{four_digits(point.lower_quartile_n)} to {four_digits(point.upper_quartile_n)}",
            str(point.strokes),
            str(point.rows),
        )
        for point in each.points
    ]
    return Table(("velocity [mm/s]", "friction [N]", "± [N]", "± [%]", "quartiles [N]", "strokes", "rows"), rows)


def _parameter_table(parameters: Sequence[IdentifiedParameter]) -> Table:
    rows: list[list[str | Cell]] = []
    for each in parameters:
        value = Cell("–", style="none") if each.value is None else four_digits(each.value)
        interval = "" if each.interval is None else " to ".join(four_digits(limit) for limit in each.interval)
        half = _percent(each.half_percent)
        rows.append([Cell(each.meaning, small=each.symbol), value, interval, half, each.shown_unit, each.remark])
    columns = ("parameter", "value", "interval", "± [%]", "unit", "remark")
    return Table(columns, rows, words=(4, 5), style="stacked")


def _percent(half: float | None) -> str:
    return "–" if half is None else f"{half:.0f}"


def _error_table(simulated: Sequence[tuple[Recording, Mapping[str, Array]]], titles: Sequence[str]) -> Table:
    """Tabulate each recording's mean absolute label, and each model's mean absolute error in percent of it."""
    rows: list[list[str | Cell]] = []
    for number, (recording, lines) in enumerate(simulated, start=1):
        label_n, usable = recording.column("friction_n"), recording.usable()
        if not usable.any():
            continue
        mean_n = float(np.mean(np.abs(label_n[usable])))
        link = f"#recording-{number}" if number <= PLOTTED else ""
        errors = [100.0 * float(np.mean(np.abs(lines[name] - label_n)[usable])) / mean_n for name in titles]
        cells = [Cell(f"{error:.1f}", value=error) for error in errors]
        rows.append([Cell(recording.name, link=link), four_digits(mean_n), *cells])
    return Table(("recording", "mean |friction| [N]", *(f"{name} [%]" for name in titles)), rows, sortable=True)


def _over_time(recording: Recording, simulated: Mapping[str, Array]) -> PageFigure:
    gaps = np.where(recording.usable(), 0.0, np.nan)
    friction = [Line("label, off line", recording.column("friction_n") + gaps, GREEN, 1.5)]
    coloured = zip(simulated.items(), COLOURS, strict=False)
    friction += [Line(title, values + gaps, colour, 1.0) for (title, values), colour in coloured]
    velocity = Line("velocity", MM_PER_M * recording.column("velocity_m_s"), BLUE, in_legend=False)
    panels = [Panel("friction [N]", friction, 1.6), Panel("velocity [mm/s]", [velocity])]
    return over_time(recording.column("time_s"), panels)
