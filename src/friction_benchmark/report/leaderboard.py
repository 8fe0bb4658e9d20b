"""The leaderboard as dots and whiskers: error, its 95 % interval, every seed, and the floor as a line to pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.report.drawing import logarithmic
from friction_benchmark.report.rows import ROW, begun
from friction_benchmark.report.words import capital, denominator, of_size, split_words, within

if TYPE_CHECKING:
    from friction_benchmark.report.model_titles import Names
    from friction_benchmark.results import TaskResult


def label_line(result: TaskResult) -> float | None:
    """Return the error of the off-line label itself, where errors are against true friction and it is known [%]."""
    known = result.label_truth_percent
    return known.value if known is not None and result.reference == "truth" else None


def leaderboard(result: TaskResult, names: Names) -> str:
    """Return the SVG: best at the top, logarithmic scale; the floor's interval is a band behind all rows."""
    words = f"{capital(result.title)}, {split_words(result.split)}: error of every model with its 95 % interval"
    rows = begun(result.entries, names, result.baseline, words, "percent")
    drawing = rows.drawing
    shown = [value for entry in result.entries for value in (entry.score.percent.low, entry.score.percent.high)]
    shown += [entry.score.percent.value for entry in result.entries]
    label = label_line(result)
    shown += [label] if label is not None else []
    scale = logarithmic(shown, rows.start, rows.end, room=1.08)
    drawing.across(scale, rows.top, rows.bottom, "{:g}".format, f"MAE [% of {denominator(result)}]")
    floor = next((entry.score.percent for entry in result.entries if entry.model == result.baseline), None)
    if floor is not None:
        band = scale(floor.low), scale(floor.high)
        drawing.box(band[0], rows.top, max(band[1] - band[0], 1.0), rows.bottom - rows.top, "#000000", 0.07)
        drawing.line(scale(floor.value), rows.top, scale(floor.value), rows.bottom, "#000000", 1.2, "4 3")
        drawing.text(scale(floor.value), rows.top - 6.0, "floor", "middle", 11.0)
    if label is not None:
        drawing.line(scale(label), rows.top, scale(label), rows.bottom, "#7A5A00", 1.6, "1 3")
        drawing.text(scale(label), rows.top - 19.0, "label", "middle", 11.0)
    for row, entry in enumerate(result.entries):
        percent, y = entry.score.percent, rows.places[row]
        colour, shape = names.mark(entry.model)
        for seed in entry.seeds.values():
            drawing.line(scale(seed), y - 0.3 * ROW, scale(seed), y + 0.3 * ROW, colour, 1.0)
        drawing.line(scale(percent.low), y, scale(percent.high), y, colour, 2.4)
        newtons = of_size(entry.score.mae_n)
        tip = f"{names.title(entry.model)}: {of_size(percent.value)} % ({within(percent)}), {newtons} N"
        drawing.mark(scale(percent.value), y, shape, colour, 5.0, tip)
        rows.number(row, of_size(percent.value), "strong" if row == 0 else "")
    return drawing.svg()
