"""One mark a test in every model's row: the error, and how often the bounds hold."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from friction_benchmark.report.drawing import Scale, logarithmic
from friction_benchmark.report.rows import ROW, TEST_MARKS, Rows, begun
from friction_benchmark.report.words import capital, of_size, share, split_words

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from friction_benchmark.report.model_titles import Names
    from friction_benchmark.results import TaskResult

COVERED = (0.87, 0.93)
"""Where 90 % bounds are meant to be."""

AFTER_REVERSAL = ("after reversal", "#000000", "diamond")


def errors_by_condition(result: TaskResult, names: Names) -> str:
    """Return the SVG of every model's error in each test; the worst test stands at the right."""
    words = f"{capital(result.title)}, {split_words(result.split)}: error of every model by test"
    entries = [entry for entry in result.entries if entry.by_condition]
    rows = begun(entries, names, result.baseline, words, "worst")
    scale = logarithmic(
        [value for entry in entries for value in entry.by_condition.values()], rows.start, rows.end, room=1.08
    )
    rows.drawing.across(scale, rows.top, rows.bottom, "{:g}".format, "MAE [% of mean |friction| of the test]")
    tests = _tests([entry.by_condition for entry in entries])
    for row, entry in enumerate(entries):
        _marks(rows, row, entry.by_condition, tests, scale, lambda value: f"{of_size(value)} %")
        rows.number(row, of_size(max(entry.by_condition.values())))
    rows.drawing.legend(_legend(tests), 4.0, 14.0)
    return rows.drawing.svg()


def coverage(result: TaskResult, names: Names) -> str:
    """Return the SVG of every model's coverage in each test and just after reversals, over the band aimed at."""
    words = f"{capital(result.title)}, {split_words(result.split)}: coverage of the 90 % bounds by test"
    entries = [entry for entry in result.entries if entry.trust is not None]
    rows = begun(entries, names, result.baseline, words, "all")
    trusts = [entry.trust for entry in entries if entry.trust is not None]
    found = [value for trust in trusts for value in (*trust.coverage.values(), trust.coverage_after_reversal)]
    least = min([value for value in found if math.isfinite(value)], default=0.8)
    scale = Scale(max(0.0, min(0.8, math.floor(20.0 * least) / 20.0)), 1.0, rows.start, rows.end)
    low, high = (scale(end) for end in COVERED)
    rows.drawing.box(low, rows.top, high - low, rows.bottom - rows.top, "#009E73", 0.16)
    rows.drawing.across(
        scale, rows.top, rows.bottom, lambda value: f"{100.0 * value:.0f}", "rows within their bounds [%]"
    )
    rows.drawing.line(scale(0.9), rows.top, scale(0.9), rows.bottom, "#00573f", 1.2, "4 3")
    tests = _tests([trust.coverage for trust in trusts])
    for row, trust in enumerate(trusts):
        place = rows.places[row]
        if "" in trust.coverage:
            here = scale(trust.coverage[""])
            rows.drawing.line(here, place - 0.42 * ROW, here, place + 0.42 * ROW, "#000000", 2.0)
            rows.number(row, share(trust.coverage[""]))
        after = trust.coverage_after_reversal
        if math.isfinite(after):
            tip = f"just after reversals: {share(after)}"
            rows.drawing.mark(scale(after), place, "diamond", "#000000", 4.4, tip, hollow=True)
        _marks(rows, row, trust.coverage, tests, scale, share)
    rows.drawing.legend([*_legend(tests), AFTER_REVERSAL], 4.0, 14.0, hollow=[AFTER_REVERSAL[0]])
    return rows.drawing.svg()


def _tests(found: Sequence[Mapping[str, float]]) -> list[str]:
    return sorted({test for values in found for test in values if test})


def _legend(tests: Sequence[str]) -> list[tuple[str, str, str]]:
    name = "condition {}" if all(len(test) < 3 for test in tests) else "{}"
    return [(name.format(test), *TEST_MARKS[index % len(TEST_MARKS)]) for index, test in enumerate(tests)]


def _marks(
    rows: Rows, row: int, values: Mapping[str, float], tests: Sequence[str], scale: Scale, form: Callable[[float], str]
) -> None:
    for index, test in enumerate(tests):
        if math.isfinite(values.get(test, math.nan)):
            colour, shape = TEST_MARKS[index % len(TEST_MARKS)]
            tip = f"condition {test}: {form(values[test])}"
            rows.drawing.mark(scale(values[test]), rows.places[row], shape, colour, 4.2, tip)
