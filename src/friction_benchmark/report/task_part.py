"""The section of one task: the honest paragraph, then every split with its pictures and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.report.by_condition import coverage, errors_by_condition
from friction_benchmark.report.costs import error_against_cost
from friction_benchmark.report.leaderboard import label_line, leaderboard
from friction_benchmark.report.overview import anchor
from friction_benchmark.report.task_tables import (
    cost_table,
    error_table,
    motion_table,
    residual_table,
    tuning_table,
)
from friction_benchmark.report.words import REFERENCES, capital, of_size, split_words, within

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_benchmark.report.model_titles import Names
    from friction_benchmark.report.page import BenchmarkPage
    from friction_benchmark.results import TaskResult

DOTS = ", the dotted line the off-line label itself"


def task_part(page: BenchmarkPage, results: Sequence[TaskResult], names: Names, finding: str) -> None:
    """Add the section of a task.

    Args:
        page: The page so far.
        results: The task's leaderboards, one a split.
        names: What the participants are called.
        finding: The paragraph that says who wins, by how much, and who does not beat the floor; empty for none.
    """
    first = results[0]
    page.part(capital(first.title), anchor(first.task))
    against = f"the {REFERENCES['label']}" if first.reference == "label" else REFERENCES[first.reference]
    asked = f"{first.explanation} " if first.explanation else ""
    page.styled(
        f"{asked}Models see {', '.join(first.inputs)}. Errors are against {against}. "
        f"The floor is: {names.title(first.baseline)}.",
        "facts",
    )
    if finding:
        page.styled(finding, "finding")
    for result in results:
        _split(page, result, names, folded=result is not first)
    _missing(page, results, names)


def _split(page: BenchmarkPage, result: TaskResult, names: Names, folded: bool) -> None:
    page.heading(f"{capital(split_words(result.split))}: mean |friction| {of_size(result.mean_friction_n)} N")
    if result.label_truth_percent is not None:
        label = result.label_truth_percent
        page.styled(
            f"The off-line label, which looks ahead, is itself {of_size(label.value)} % ({within(label)}) away from "
            "true friction.",
            "facts",
        )
    page.figures(
        (
            leaderboard(result, names),
            "Error and its 95 % block-bootstrap interval; thin strokes are single seeds; the grey band is the "
            f"floor's interval{DOTS if label_line(result) is not None else ''}. Logarithmic scale.",
        ),
        (
            error_against_cost(result, names),
            "Error against arithmetic. The dashed line is the Pareto front: nothing cheaper is better. Hold the "
            "mouse over a mark for its name.",
        ),
    )
    if not folded:
        page.raw(error_table(result, names))
    further = []
    if any(entry.by_condition for entry in result.entries):
        further.append((errors_by_condition(result, names), "Error by test; logarithmic scale."))
    if any(entry.trust is not None for entry in result.entries):
        further.append(
            (
                coverage(result, names),
                "How many labels lie within the 90 % bounds, which were calibrated on labels. Black strokes: all tests "
                "together. The green band, 87 to 93 %, is where marks are meant to be.",
            )
        )
    if further:
        page.figures(*further)
    if folded:
        page.folded_content("Every measure of error", error_table(result, names))
    page.folded_content("Where in the motion, and by test", motion_table(result, names))
    page.folded_content("What an estimate costs, and how far it can be trusted", cost_table(result, names))
    for words, content in (
        ("What is left: residuals", residual_table(result, names)),
        ("What tuning chose", tuning_table(result, names)),
    ):
        if content:
            page.folded_content(words, content)


def _missing(page: BenchmarkPage, results: Sequence[TaskResult], names: Names) -> None:
    reasons: dict[str, list[str]] = {}
    for result in results:
        for model, reason in result.missing.items():
            titles = reasons.setdefault(reason, [])
            if names.title(model) not in titles:
                titles.append(names.title(model))
    if reasons:
        page.heading("Models that cannot do this task")
        page.points([f"{', '.join(titles)}: {reason}" for reason, titles in reasons.items()])
