"""Charts of one leaderboard: errors with their intervals, and error against cost."""

import math
from collections.abc import Sequence
from typing import Any

from cylinder_friction.reporting.page import PageFigure
from cylinder_friction.reporting.style import BLACK, BROWN, INK, QUIET
from friction_benchmark.report.model_titles import ModelTitles
from friction_benchmark.report.words import capital, counted, denominator, of_size, within
from friction_benchmark.results import Entry, TaskResult

ROW = 22
LONGEST = 34  # Longer titles are cut at the axis; the mouse shows them whole


def leaderboard(result: TaskResult, titles: ModelTitles) -> PageFigure:
    """Return one row per model, best at the top: error, its 95 % interval, every seed, and the baseline's interval."""
    figure = PageFigure()
    strokes = [(row, _short(seed)) for row, entry in enumerate(result.entries) for seed in entry.seeds.values()]
    if strokes:
        rows, seeds = zip(*strokes, strict=True)
        marker = {"symbol": "line-ns-open", "size": 11, "color": QUIET, "line": {"width": 1}}
        figure.add(x=seeds, y=rows, mode="markers", name="single seeds", marker=marker, hoverinfo="skip")
    for family, (colour, _, symbol) in titles.legend(entry.model for entry in result.entries):
        chosen = [(row, entry) for row, entry in enumerate(result.entries) if titles.family(entry.model) == family]
        percents = [entry.score.percent for _, entry in chosen]
        whiskers = {
            "type": "data",
            "symmetric": False,
            "array": [_short(each.high - each.value) for each in percents],
            "arrayminus": [_short(each.value - each.low) for each in percents],
            "color": colour,
            "thickness": 2.2,
            "width": 0,
        }
        tips = [
            f"{titles(entry.model)}<br>{of_size(entry.score.percent.value)} % ({within(entry.score.percent)}), "
            f"{of_size(entry.score.mae_n)} N"
            for _, entry in chosen
        ]
        figure.add(
            x=[_short(each.value) for each in percents],
            y=[row for row, _ in chosen],
            mode="markers",
            name=family,
            marker={"symbol": symbol, "size": 9, "color": colour},
            hovertext=tips,
            hoverinfo="text",
            error_x=whiskers,
        )
    baseline = result.entry_of(result.baseline)
    if baseline is not None and _drawable(baseline.score.percent.value):
        _band(figure, "x", baseline.score.percent.low, baseline.score.percent.high, BLACK, 0.07)
        _upright(figure, baseline.score.percent.value, "baseline", BLACK, "dash")
    if (label := label_percent(result)) is not None and _drawable(label):
        _upright(figure, label, "label", BROWN, "dot")
    for row, entry in enumerate(result.entries):
        figure.note(of_size(entry.score.percent.value), xref="paper", x=1.0, xanchor="left", xshift=6, y=row)
        if entry.model == result.baseline:
            _band(figure, "y", row - 0.5, row + 0.5, "#EBEEF1")
    shown = [entry.score.percent.value for entry in result.entries]
    names = [_cut(titles(entry.model), LONGEST) for entry in result.entries]
    figure.x_axis(title=f"MAE [% of {denominator(result)}]", type="log", **_ticks(shown))
    figure.y_axis(tickvals=list(range(len(names))), ticktext=names, range=[len(names) - 0.5, -0.5], showgrid=False)
    return figure.look(ROW * len(names) + 130, legend_rows=2, margin={"r": 62, "l": 8, "t": 102, "b": 48})


def _band(figure: PageFigure, axis: str, low: float, high: float, colour: str, opacity: float = 1.0) -> None:
    """Shade what lies between two values of an axis, ``x`` or ``y``, below all else."""
    across = "y" if axis == "x" else "x"
    ends = {f"{axis}0": low, f"{axis}1": high, f"{axis}ref": axis}
    ends |= {f"{across}0": 0, f"{across}1": 1, f"{across}ref": f"{across} domain"}
    fill = {"fillcolor": colour, "opacity": opacity, "line": {"width": 0}, "layer": "below"}
    figure.layout["shapes"].append({"type": "rect", **ends, **fill})


def label_percent(result: TaskResult) -> float | None:
    """Return the error of the off-line label itself, where errors are against true friction and it is known [%]."""
    known = result.label_truth_percent
    return known.value if known is not None and result.reference == "truth" else None


def pareto_front(entries: Sequence[Entry]) -> list[Entry]:
    """Return the models that no other beats at the same or a lower cost, cheapest first."""
    front: list[Entry] = []
    for entry in sorted(entries, key=lambda entry: (entry.multiply_adds, entry.score.percent.value)):
        if not front or entry.score.percent.value < front[-1].score.percent.value:
            front.append(entry)
    return front


def error_against_cost(result: TaskResult, titles: ModelTitles) -> PageFigure:
    """Return the chart, both scales logarithmic; a model without arithmetic stands at one multiply-add."""
    figure = PageFigure()
    entries = [entry for entry in result.entries if _drawable(entry.score.percent.value)]
    front = pareto_front(entries)
    figure.add(
        x=[max(1, entry.multiply_adds) for entry in front],
        y=[_short(entry.score.percent.value) for entry in front],
        mode="lines+markers+text",
        marker={"size": 14, "opacity": 0.0},
        text=[_cut(titles(entry.model), 26) for entry in front],
        textposition=["bottom right" if 2 * place < len(front) else "bottom left" for place in range(len(front))],
        textfont={"size": 11, "color": INK},
        line={"color": INK, "width": 1.2, "dash": "dash", "shape": "hv"},
        name="Pareto front",
        hoverinfo="skip",
        cliponaxis=False,
    )
    for family, (colour, _, symbol) in titles.legend(entry.model for entry in entries):
        chosen = [entry for entry in entries if titles.family(entry.model) == family]
        figure.add(
            x=[max(1, entry.multiply_adds) for entry in chosen],
            y=[_short(entry.score.percent.value) for entry in chosen],
            mode="markers",
            name=family,
            marker={"symbol": symbol, "size": 11, "color": colour, "line": {"color": "#fff", "width": 1}},
            hovertext=[
                f"{titles(entry.model)}<br>{of_size(entry.score.percent.value)} %, {counted(entry.multiply_adds)} "
                f"multiply-adds, {of_size(entry.step_us)} µs"
                for entry in chosen
            ],
            hoverinfo="text",
        )
    shown = [entry.score.percent.value for entry in entries]
    figure.x_axis(title="multiply-adds per sample", type="log", exponentformat="power", dtick=1)
    figure.y_axis(title=f"MAE [% of {denominator(result)}]", type="log", **_ticks(shown))
    return figure.look(max(400, ROW * len(result.entries) + 110), legend_rows=2)


def _upright(figure: PageFigure, value: float, words: str, colour: str, dash: str) -> None:
    figure.upright(value, {"color": colour, "width": 1.4, "dash": dash})
    figure.note(words, yref="paper", y=1.0, yanchor="bottom", x=math.log10(value))


def _ticks(values: Sequence[float]) -> dict[str, Any]:
    """Return round ticks of a logarithmic axis."""
    inside = [value for value in values if _drawable(value)] or [1.0]
    steps = (1, 2, 5) if max(inside) > 6.0 * min(inside) else (1, 1.5, 2, 3, 4, 5, 7)
    powers = range(math.floor(math.log10(min(inside))) - 1, math.ceil(math.log10(max(inside))) + 1)
    ticks = [step * 10.0**power for power in powers for step in steps]
    return {"tickvals": ticks, "ticktext": [f"{tick:g}" for tick in ticks]}


def _drawable(value: float) -> bool:
    return math.isfinite(value) and value > 0.0


def _short(value: float) -> float | None:
    """Return a number with five digits, which is finer than a pixel; None where there is none."""
    return float(f"{value:.5g}") if math.isfinite(value) else None


def _cut(words: str, length: int) -> str:
    return capital(words if len(words) <= length else f"{words[: length - 1].rstrip()}…")
