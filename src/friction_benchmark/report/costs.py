"""Error against the cost of a step, with the Pareto front: the models that nothing cheaper beats."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from friction_benchmark.report.drawing import WIDTH, Drawing, logarithmic
from friction_benchmark.report.labels import LABEL, Labels
from friction_benchmark.report.rows import FOOT, ROW, TOP, fitting
from friction_benchmark.report.words import capital, counted, denominator, of_size, split_words

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_benchmark.report.model_titles import Names
    from friction_benchmark.results import Entry, TaskResult

HEIGHT = 400.0
_MARK = 6.0
_LEFT, _RIGHT, _TOP = 44.0, WIDTH - 14.0, TOP + 6.0
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def pareto_front(entries: Sequence[Entry]) -> list[Entry]:
    """Return the models that no other beats at the same or a lower cost, cheapest first."""
    front: list[Entry] = []
    for entry in sorted(entries, key=lambda entry: (entry.multiply_adds, entry.score.percent.value)):
        if not front or entry.score.percent.value < front[-1].score.percent.value:
            front.append(entry)
    return front


def error_against_cost(result: TaskResult, names: Names) -> str:
    """Return the SVG; both scales are logarithmic, a model without arithmetic stands at one multiply-add."""
    words = f"{capital(result.title)}, {split_words(result.split)}: error against multiply-adds a step, Pareto front"
    entries = result.entries
    drawing = Drawing(max(HEIGHT, TOP + ROW * len(entries) + FOOT), words)
    bottom = drawing.height - FOOT
    across = logarithmic([max(1.0, entry.multiply_adds) for entry in entries], _LEFT, _RIGHT, room=1.8, least=100.0)
    up = logarithmic([entry.score.percent.value for entry in entries], bottom, _TOP, room=1.12)
    drawing.up(up, _LEFT, _RIGHT, "{:g}".format, f"MAE [% of {denominator(result)}]")
    drawing.across(across, _TOP, bottom, _power, "multiply-adds a step")
    places = {e.model: (across(max(1.0, e.multiply_adds)), up(e.score.percent.value)) for e in entries}
    front = [entry.model for entry in pareto_front(entries)]
    labels = Labels(drawing, (_LEFT, _TOP, _RIGHT, bottom))
    _draw_front(drawing, labels, [places[model] for model in front])
    for entry in entries:
        title, (x, y), (colour, shape) = names.title(entry.model), places[entry.model], names.mark(entry.model)
        tip = (
            f"{title}: {of_size(entry.score.percent.value)} %, {counted(entry.multiply_adds)} multiply-adds, "
            f"{of_size(entry.step_us)} µs"
        )
        drawing.mark(x, y, shape, colour, _MARK, tip)
        labels.keep_clear((x, y), _MARK)
    for model in [*front, *(entry.model for entry in entries if entry.model not in front)]:
        labels.add(places[model], fitting(names.title(model), 180.0, LABEL), model in front)
    return drawing.svg()


def _draw_front(drawing: Drawing, labels: Labels, points: Sequence[tuple[float, float]]) -> None:
    steps = [(points[0][0], _TOP)]
    for x, y in points:
        steps += [(x, steps[-1][1]), (x, y)]
    steps.append((_RIGHT, points[-1][1]))
    drawing.path(steps, "#1d2733", 1.4, "5 3")
    for start, end in pairwise(steps):
        labels.keep_clear_line(start, end)


def _power(value: float) -> str:
    """Return a small number as it is, one from 1000 on with its power of ten."""
    mantissa, exponent = f"{value:e}".split("e")
    if value < 1000.0:
        return f"{value:g}"
    head = "" if float(mantissa) == 1.0 else f"{float(mantissa):g}·"
    return f"{head}10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
