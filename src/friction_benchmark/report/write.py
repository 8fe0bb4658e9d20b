"""The whole page, from the overview to the budget."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from cylinder_friction.recordings.files import write_text
from friction_benchmark.report.drawing import Drawing
from friction_benchmark.report.grid import Cell, table
from friction_benchmark.report.model_titles import Names
from friction_benchmark.report.overview import heat_key, heat_map, main_split, winners
from friction_benchmark.report.page import BenchmarkPage
from friction_benchmark.report.task_part import task_part
from friction_benchmark.report.words import capital, of_size, plain, split_words

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from friction_benchmark.results import BenchmarkResults, TaskResult

DEFINITIONS = [
    "MAE: mean absolute error over the usable rows. Percent: MAE divided by the mean absolute reference of the same "
    "rows; the head of every table names that denominator.",
    "Intervals: 95 %, by a bootstrap over blocks of neighbouring rows. The margin to the floor is bootstrapped in "
    "pairs, both models on the same blocks.",
    "Floor: what needs no learning. Who does not beat it has learned nothing of use in that task.",
    "Bias: mean of estimate minus reference. Lag: the shift at which estimate and reference are most alike; positive "
    "is late. 95th percentile: of the absolute error.",
    "At rest, near zero velocity and sliding share all rows among them; just after a reversal, extending and "
    "retracting overlap with them.",
    "Coverage: share of rows whose reference lies in the 90 % bounds. Out of range: rows whose input lies outside "
    "what the model was trained on; flagged: rows the model says so of.",
    "Residuals of friction are never independent: judge the size of skewness, kurtosis and correlation, not their "
    "significance.",
]


def write_report(results: BenchmarkResults, findings: Mapping[str, str], path: Path) -> None:
    """Write the benchmark as one HTML page that loads nothing; equal results make equal bytes.

    Args:
        results: What was found; at least one leaderboard with at least one entry, each best first.
        findings: The honest paragraph of each task, by the task's name.
        path: Of the HTML file; its folder is made.

    Raises:
        ValueError: There is no leaderboard, or one without entries.
    """
    write_text(path, report_html(results, findings))


def report_html(results: BenchmarkResults, findings: Mapping[str, str]) -> str:
    """Return the page that ``write_report`` writes."""
    empty = [f"{result.task}, {split_words(result.split)}" for result in results.tasks if not result.entries]
    if empty or not results.tasks:
        raise ValueError(f"expected leaderboards with entries, but got none in: {'; '.join(empty) or 'the results'}")
    names = Names(results.models)
    tasks: dict[str, list[TaskResult]] = {}
    for result in results.tasks:
        tasks.setdefault(result.task, []).append(result)
    models = {entry.model for result in results.tasks for entry in result.entries}
    page = BenchmarkPage(
        "Friction models compared",
        f"{len(models)} models, {len(tasks)} tasks, {len(results.tasks)} leaderboards. Test recordings come from "
        "sessions, loads, temperatures or rigs that no model was trained or tuned on.",
    )
    _overview(page, results, names, models)
    for task, found in tasks.items():
        task_part(page, found, names, findings.get(task, ""))
    _participants(page, results, names)
    page.part("Budget", "budget")
    page.text("Every model was tuned with the same number of trials, the first of which is its source's own choice.")
    facts = "".join(_budget_entry(plain(name), value) for name, value in results.budget.items())
    page.raw(f"<dl>{facts}</dl>")
    page.part("How to read the numbers", "reading")
    page.points(DEFINITIONS)
    return page.html()


def _overview(page: BenchmarkPage, results: BenchmarkResults, names: Names, models: set[str]) -> None:
    page.part("Overview", "overview")
    split = main_split(results)
    page.heading(f"Every model in every task: {split_words(split)}")
    page.raw(heat_key())
    page.raw(heat_map([result for result in results.tasks if result.split == split], names))
    others = [result for result in results.tasks if result.split != split]
    if others:
        page.heading("Further from the training data: other splits")
        order = list(dict.fromkeys(result.split for result in others))
        page.raw(heat_map(sorted(others, key=lambda result: order.index(result.split)), names))
    page.heading("Who wins what")
    page.raw(winners(results, names))
    if results.missing:
        page.heading("What could not be asked")
        page.points([f"{capital(plain(task))}: {reason}" for task, reason in results.missing.items()])
    drawing = Drawing(24.0, "Colours and shapes of the families of models")
    drawing.legend(names.legend(models), 4.0, 16.0)
    page.styled("Percent of the mean |friction| below each task's name. Colours and shapes in every figure:", "facts")
    page.raw(drawing.svg())


def _participants(page: BenchmarkPage, results: BenchmarkResults, names: Names) -> None:
    page.part("Participants", "participants")
    page.text("Where each model comes from, and what was taken where its source leaves something open.")
    rows = []
    for model in names.by_family(results.models):
        who = results.models[model]
        cells = [Cell(who.family, style="words"), Cell(who.source, style="words"), Cell(who.chosen, style="words")]
        rows.append([Cell(who.title, small=model), *cells])
    head = [Cell("Model"), *(Cell(words, style="words") for words in ("family", "source", "what was chosen"))]
    page.raw(table(head, rows))


def _budget_entry(name: str, value: float | int | str) -> str:
    """Return one entry of the budget as HTML."""
    words = of_size(value) if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else value
    return f"<div><dt>{html.escape(capital(name))}</dt><dd>{html.escape(words)}</dd></div>"
