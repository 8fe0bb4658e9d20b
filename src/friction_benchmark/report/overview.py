"""All tasks at once: who wins what, and every model's error in every task against the floor."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

from friction_benchmark.report.grid import Cell, shade, table
from friction_benchmark.report.task_tables import EMPTY, against_baseline, margin_cell
from friction_benchmark.report.words import (
    SPLITS,
    capital,
    of_size,
    plain,
    split_words,
    within,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_benchmark.report.model_titles import Names
    from friction_benchmark.results import BenchmarkResults, Entry, TaskResult


def anchor(task: str) -> str:
    """Return where a task's section can be linked to."""
    return "task-" + "".join(letter if letter.isalnum() else "-" for letter in task)


def main_split(results: BenchmarkResults) -> str:
    """Return the split of the first heat map: held-out sessions, or the first there is."""
    splits = [result.split for result in results.tasks]
    return min(splits, key=lambda split: (split != next(iter(SPLITS)), splits.index(split)))


def verdict(result: TaskResult) -> str:
    """Return in words whether the best model beats the floor outside the paired interval."""
    best = result.entries[0]
    if best.model == result.baseline:
        return "nothing beats the floor"
    if best.below_baseline is None:
        return "not compared with the floor"
    return "beats the floor" if best.below_baseline.low > 0.0 else "not to be told from the floor"


def winners(results: BenchmarkResults, names: Names) -> str:
    """Return a table with one row a leaderboard: its best model, the floor, and what lies between them."""
    rows = []
    for result in results.tasks:
        best = result.entries[0]
        floor = next((entry for entry in result.entries if entry.model == result.baseline), None)
        better = sum(entry.below_baseline is not None and entry.below_baseline.low > 0.0 for entry in result.entries)
        said = verdict(result)
        percent = best.score.percent
        rows.append(
            [
                Cell(capital(result.title), split_words(result.split), link=f"#{anchor(result.task)}"),
                Cell(names.title(best.model), names.family(best.model), style="words"),
                Cell(of_size(percent.value), within(percent), percent.value),
                Cell(of_size(floor.score.percent.value), names.title(floor.model), floor.score.percent.value)
                if floor
                else Cell(names.title(result.baseline)),
                margin_cell(best.below_baseline),
                Cell(said, style="words good" if said == "beats the floor" else "words bad"),
                Cell(f"{better} of {len(result.entries) - (floor is not None)}", value=better),
            ]
        )
    head = [Cell("Task"), Cell("best model", style="words"), Cell("its error [%]"), Cell("floor [%]")]
    head += [Cell("margin [points]"), Cell("verdict", style="words"), Cell("models that beat the floor")]
    return table(head, rows, style="winners")


def heat_map(results: Sequence[TaskResult], names: Names) -> str:
    """Return models by tasks, percent in every cell, coloured by the ratio to the floor of the column.

    Models stand family by family, within each the one first that does best against the floors.
    """
    models = list(dict.fromkeys(entry.model for result in results for entry in result.entries))
    models = names.by_family(sorted(models, key=lambda model: _standing(model, results)))
    head = [
        Cell(capital(plain(result.task)), f"of {of_size(result.mean_friction_n)} N", link=f"#{anchor(result.task)}")
        for result in results
    ]
    rows = [
        [Cell(names.title(model), names.family(model)), *(_cell(model, result, names) for result in results)]
        for model in models
    ]
    groups: list[tuple[str, int]] = [("", 1)]
    for result in results:
        words = split_words(result.split)
        if groups[-1][0] == words:
            groups[-1] = (words, groups[-1][1] + 1)
        else:
            groups.append((words, 1))
    return table([Cell("Model"), *head], rows, groups if len(groups) > 2 else (), "heat")


def heat_key() -> str:
    """Return the legend of the heat map as HTML."""
    entries = [
        (f'<i style="background:{shade(strength)[0]};border:1px solid #c9d1d9"></i>', words)
        for strength, words in (
            (-1.0, "half the floor's error or less"),
            (-0.4, "better than the floor"),
            (0.0, "as the floor"),
            (0.4, "worse"),
            (1.0, "twice the floor's error or more"),
        )
    ]
    entries += [('<i style="outline:2px solid #1d2733"></i>', "best of its task")]
    entries += [('<i style="border:2px dashed #1d2733"></i>', "the floor")]
    entries += [("<b>≈ </b>", "the paired 95 % interval cannot tell it from the floor")]
    return '<p class="key">' + "".join(f"<span>{mark}{html.escape(words)}</span>" for mark, words in entries) + "</p>"


def _found(model: str, result: TaskResult) -> Entry | None:
    return next((entry for entry in result.entries if entry.model == model), None)


def _floor(result: TaskResult) -> float:
    floor = _found(result.baseline, result)
    return floor.score.percent.value if floor else math.nan


def _standing(model: str, results: Sequence[TaskResult]) -> float:
    """Return the mean over the tasks of the shade of a model's cells."""
    shades = []
    for result in results:
        entry = _found(model, result)
        strength = against_baseline(entry.score.percent.value, _floor(result)) if entry else None
        if strength is not None:
            shades.append(strength)
    return sum(shades) / len(shades) if shades else math.inf


def _cell(model: str, result: TaskResult, names: Names) -> Cell:
    entry = _found(model, result)
    if entry is None:
        return Cell(EMPTY.words, style="none", tip=result.missing.get(model, "not run"))
    percent, below = entry.score.percent, entry.below_baseline
    unclear = below is not None and below.low <= 0.0 <= below.high
    style = " ".join(
        words for words, holds in (("best", entry is result.entries[0]), ("floor", model == result.baseline)) if holds
    )
    return Cell(
        f"{'≈ ' if unclear else ''}{of_size(percent.value)}",
        value=percent.value,
        shade=against_baseline(percent.value, _floor(result)),
        style=style,
        tip=f"{names.title(model)}: {of_size(percent.value)} % ({within(percent)}), {of_size(entry.score.mae_n)} N",
    )
