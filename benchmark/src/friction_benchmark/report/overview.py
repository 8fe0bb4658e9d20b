"""All tasks at once: every model's error in every task against the baseline."""

import math
from collections.abc import Sequence
from dataclasses import replace

from cylinder_friction.reporting.page import NONE, Cell, Table
from friction_benchmark.report.model_titles import ModelTitles
from friction_benchmark.report.task_tables import against_baseline
from friction_benchmark.report.words import capital, of_size, plain, split_words, within
from friction_benchmark.results import TaskResult


def anchor(task: str) -> str:
    """Return the address of a task's section within the page."""
    return "task-" + "".join(letter if letter.isalnum() else "-" for letter in task)


def heat_map(results: Sequence[TaskResult], titles: ModelTitles) -> Table:
    """Return models by tasks, percent in every cell, coloured by the ratio to the baseline of the column.

    Models stand family by family, within each the one first that does best against the baselines.
    """
    models = list(dict.fromkeys(entry.model for result in results for entry in result.entries))
    models = titles.by_family(sorted(models, key=lambda model: _standing(model, results)))
    head: list[str | Cell] = ["Model"]
    groups: list[tuple[str, int]] = [("", 1)]
    for result in results:
        small, link = f"of {of_size(result.mean_friction_n)} N", f"#{anchor(result.task)}"
        head.append(Cell(capital(plain(result.task)), small, link=link))
        words, (last, width) = split_words(result.split), groups[-1]
        groups[-1:] = [(words, width + 1)] if last == words else [(last, width), (words, 1)]
    rows = [
        [Cell(titles(model), titles.family(model)), *(_cell(model, result, titles) for result in results)]
        for model in models
    ]
    return Table(head, rows, groups=groups if len(groups) > 2 else (), style="heat", sortable=True)


def _baseline(result: TaskResult) -> float:
    baseline = result.entry_of(result.baseline)
    return baseline.score.percent.value if baseline else math.nan


def _standing(model: str, results: Sequence[TaskResult]) -> float:
    """Return the mean over the tasks of the shade of a model's cells."""
    entries = [(result.entry_of(model), _baseline(result)) for result in results]
    shades = [against_baseline(entry.score.percent.value, baseline) for entry, baseline in entries if entry]
    known = [shade for shade in shades if shade is not None]
    return sum(known) / len(known) if known else math.inf


def _cell(model: str, result: TaskResult, titles: ModelTitles) -> Cell:
    entry = result.entry_of(model)
    if entry is None:
        return replace(NONE, tip=result.missing.get(model, "not run"))
    percent, below = entry.score.percent, entry.below_baseline
    unclear = below is not None and below.low <= 0.0 <= below.high
    marks = {"best": entry is result.entries[0], "baseline": model == result.baseline}
    return Cell(
        f"{'≈ ' if unclear else ''}{of_size(percent.value)}",
        value=percent.value,
        shade=against_baseline(percent.value, _baseline(result)),
        style=" ".join(mark for mark, holds in marks.items() if holds),
        tip=f"{titles(model)}: {of_size(percent.value)} % ({within(percent)}), {of_size(entry.score.mae_n)} N",
    )
