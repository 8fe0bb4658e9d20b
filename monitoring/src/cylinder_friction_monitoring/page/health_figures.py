"""Draw the figures of the health page: a trend in a line of text, a cylinder's life, and two strokes compared."""

import math
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from cylinder_friction.reporting.frame import BLUE, BROWN, GREEN, INK, ORANGE, PALE, QUIET, SKY, PageFigure
from cylinder_friction_monitoring.trends.assessment import Assessment, Entry
from cylinder_friction_monitoring.trends.cylinder_line import Trend
from cylinder_friction_monitoring.trends.in_force import NEW_BASELINE
from cylinder_friction_monitoring.trends.session_row import COVARIATES, INDICATORS, SessionRow

WIDTH, HEIGHT, MARGIN = 220, 40, 4
BAND = 2.0  # Half-width of the band around a baseline, in scatters of a session
TITLES = {name: f"{each.name} [{each.unit}]" for name, each in INDICATORS.items()}
COVARIATE_PANELS = (
    ("oil [°C]", ("oil_temperature_c",)),
    ("pressures [bar]", ("pressure_1_bar", "pressure_2_bar")),
    ("speed [m/s]", ("speed_m_s",)),
    ("load [N]", ("load_n",)),
    ("travel [m]", ("travel_m",)),
)


def trend_picture(trend: Trend) -> Markup:
    """Draw a trend for a line of text: baseline band, sessions, and the change in orange."""
    known = [value for value in trend.values if value is not None]
    if not known:
        return Markup('<span class="none">no trend yet</span>')
    band = BAND * (trend.scatter or 0.0)
    ends = [*known, *([] if trend.level is None else [trend.level - band, trend.level + band])]
    low, high = min(ends), max(ends)
    span = (high - low) or abs(high) or 1.0

    def x(place: float) -> float:
        return MARGIN + (WIDTH - 2 * MARGIN) * place / max(len(trend.values) - 1, 1)

    def y(value: float) -> float:
        return HEIGHT - MARGIN - (HEIGHT - 2 * MARGIN) * (value - low) / span

    def line(first: int, last: int, style: str) -> str:
        own = [(place, value) for place, value in enumerate(trend.values) if first <= place <= last]
        points = " ".join(f"{x(place):.0f},{y(value):.1f}" for place, value in own if value is not None)
        return f'<polyline class="{style}" points="{points}"/>'

    parts = []
    if trend.level is not None:
        top = y(trend.level + band)
        height = max(y(trend.level - band) - top, 1.0)
        parts.append(f'<rect class="band" x="0" y="{top:.1f}" width="{WIDTH}" height="{height:.1f}"/>')
        end, middle = x(max(trend.baseline - 1, 0)), y(trend.level)
        parts.append(f'<path class="base" d="M{MARGIN},{middle:.1f}H{end:.0f}"/>')
    last = len(trend.values) - 1
    since = last if trend.since is None else trend.since
    parts.append(line(0, since, "past"))
    if trend.since is not None:
        parts.append(line(since, last, "changed"))
    newest = max(place for place, value in enumerate(trend.values) if value is not None)
    shade = "past" if trend.since is None else "changed"
    parts.append(f'<circle class="{shade}" cx="{x(newest):.0f}" cy="{y(trend.values[newest] or 0.0):.1f}" r="3"/>')
    words = f"trend of {INDICATORS[trend.indicator].name}"
    return Markup(  # noqa: S704 - numbers and words of our own
        f'<svg class="trend" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{words}">{"".join(parts)}</svg>'
    )


def life_figure(found: Assessment, rows: Sequence[SessionRow], entries: Sequence[Entry]) -> PageFigure:
    """Draw a cylinder's life: indicators with bands and alarms, services, and the covariates below."""
    dated = all(row.start for row in rows)
    places: dict[str, Any] = {row.session: row.start if dated else place for place, row in enumerate(rows, start=1)}
    first = [each.indicator for each in found.changes]
    shown = [*dict.fromkeys([*first, *INDICATORS])]
    shown = [name for name in shown if any(row.indicators[name].value is not None for row in rows)]
    below = [(title, names) for title, names in COVARIATE_PANELS if any(_known(rows, name) for name in names)]
    shares = [2.0 if place == 0 else 1.0 for place in range(len(shown))] + [0.8] * len(below)
    figure = PageFigure(shares or [1.0], 0.34 / max(len(shares), 2), below=True)
    for panel, name in enumerate(shown, start=1):
        _indicator(figure, panel, name, found, rows, places)
    for panel, (title, names) in enumerate(below, start=len(shown) + 1):
        for name, colour in zip(names, (BROWN, SKY), strict=False):
            values = [row.covariates.get(name) for row in rows]
            figure.add(
                panel,
                x=list(places.values()),
                y=values,
                mode="lines",
                name=name.rpartition("_")[0].replace("_", " "),
                line={"color": colour, "width": 1.2},
                showlegend=False,
                hovertemplate=f"%{{y:.4~g}} {COVARIATES[name].unit}<extra></extra>",
            )
        _title(figure, panel, title)
    for entry in entries:
        if dated and entry.kind in NEW_BASELINE and not entry.withdrawn and entry.time <= rows[-1].start:
            _upright(figure, entry.time, BLUE, entry.kind)
    for change in found.changes[:1]:
        _upright(figure, places.get(change.since), ORANGE, "since")
        _upright(figure, places.get(change.alarm_session), INK, "alarm")
    figure.x_axis(max(len(shares), 1), "" if dated else "session")
    return figure.look(round(118 * sum(shares)) + 130, 3, hovermode="x")


def _indicator(
    figure: PageFigure, panel: int, name: str, found: Assessment, rows: Sequence[SessionRow], places: dict[str, Any]
) -> None:
    trend, (unit, _, _, factor) = found.trends.get(name), INDICATORS[name]
    _title(figure, panel, TITLES[name])
    base = None if trend is None else trend.baseline
    if base is not None:
        ends = [next(iter(places.values())), next(reversed(places.values()))]
        level, half = factor * base.level, factor * BAND * base.scatter
        common = {"mode": "lines", "hoverinfo": "skip", "line": {"width": 0}, "legendgroup": "band"}
        figure.add(panel, x=ends, y=[level - half] * 2, name="band", showlegend=False, **common)
        band = {"fill": "tonexty", "fillcolor": "rgba(0,158,115,.14)"}
        label = f"baseline ± {BAND:g} scatters of a session"
        figure.add(panel, x=ends, y=[level + half] * 2, name=label, showlegend=panel == 1, **common, **band)
        stretch = [places.get(base.first), places.get(base.last)]
        line = {"color": GREEN, "width": 3}
        named = {"name": "baseline", "legendgroup": "baseline", "showlegend": panel == 1, "hoverinfo": "skip"}
        figure.add(panel, x=stretch, y=[level] * 2, mode="lines", line=line, **named)
    measured = [None if (value := row.indicators[name].value) is None else factor * value for row in rows]
    marks = {"color": PALE, "size": 4}
    named = {"name": "as measured", "legendgroup": "measured", "showlegend": panel == 1}
    figure.add(panel, x=list(places.values()), y=measured, mode="markers", marker=marks, **named, hoverinfo="skip")
    if trend is None or not any(value is not None for value in trend.compensated):
        return
    tested = zip(trend.sessions, trend.compensated, strict=True)
    own = [(places[session], value) for session, value in tested if session in places]
    values = [None if value is None else factor * value for _, value in own]
    figure.add(
        panel,
        x=[place for place, _ in own],
        y=values,
        mode="lines+markers",
        marker={"color": INK, "size": 4},
        line={"color": INK, "width": 1},
        name="compensated for oil, pressure, speed and load",
        legendgroup="compensated",
        showlegend=panel == 1,
        hovertemplate=f"%{{y:.4~g}} {unit}<extra></extra>",
    )


def strokes_figure(then: SessionRow, now: SessionRow) -> PageFigure:
    """Draw force over position for one stroke in each direction of two sessions, to compare them."""
    figure = PageFigure()
    for row, label, colour, width in ((then, "then", PALE, 3.0), (now, "now", ORANGE, 1.6)):
        for way, points in sorted(row.stroke.items()):
            ordered = sorted(points)
            figure.add(
                x=[1e3 * x for x, _ in ordered],
                y=[force for _, force in ordered],
                mode="lines",
                line={"color": colour, "width": width},
                name=f"{label}: {row.start[:10] or row.session}",
                legendgroup=label,
                showlegend=not figure.shows(f"{label}: {row.start[:10] or row.session}"),
                hovertemplate=f"{way}: %{{y:.0f}} N<extra></extra>",
            )
    figure.x_axis(1, "position [mm]")
    figure.y_axis(1, "force [N]", zeroline=True, zerolinecolor=QUIET)
    return figure.look(360, 1)


def _known(rows: Sequence[SessionRow], name: str) -> bool:
    values = [row.covariates.get(name) for row in rows]
    return any(value is not None and math.isfinite(value) and value != 0.0 for value in values)


def _title(figure: PageFigure, panel: int, words: str) -> None:
    """Put a panel's title above it, where small screens also have room for it."""
    top = figure.layout[f"yaxis{'' if panel == 1 else panel}"]["domain"][1]
    figure.note(words, x=0.0, xref="paper", y=top, yref="paper", xanchor="left", yanchor="bottom")
    figure.y_axis(panel, nticks=5, exponentformat="power")


def _upright(figure: PageFigure, place: Any, colour: str, words: str) -> None:
    if place is None:
        return
    figure.upright(place, {"color": colour, "width": 1.4, "dash": "dot" if colour == BLUE else "solid"}, "paper")
    side = "right" if colour == ORANGE else "left"
    font = {"size": 11, "color": colour}
    figure.note(words, x=place, xref="x", y=1.0, yref="paper", xanchor=side, yanchor="bottom", font=font)
