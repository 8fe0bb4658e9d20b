"""The benchmark as one HTML page: an overview of all tasks, then every leaderboard with its charts and tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cylinder_friction.files.whole_files import write_text
from cylinder_friction.reporting.page import Cell, Table, page_html
from friction_benchmark.folds import HELD_OUT
from friction_benchmark.report import charts, task_tables
from friction_benchmark.report.model_titles import ModelTitles
from friction_benchmark.report.overview import anchor, heat_map
from friction_benchmark.report.words import capital, of_size, plain, split_words, within
from friction_benchmark.results import BenchmarkResults, TaskResult


def write_report(results: BenchmarkResults, findings: Mapping[str, str], path: Path) -> None:
    """Write the benchmark as one HTML page that loads nothing; equal results make equal bytes."""
    write_text(path, report_html(results, findings))


def report_html(results: BenchmarkResults, findings: Mapping[str, str]) -> str:
    """Return the page of leaderboards, each with entries, best first; ``findings`` are by the task's name."""
    empty = [f"{result.task}, {split_words(result.split)}" for result in results.tasks if not result.entries]
    if empty or not results.tasks:
        raise ValueError(f"expected leaderboards with entries, but got none in: {'; '.join(empty) or 'the results'}")
    titles = ModelTitles(results.models)
    tasks: dict[str, list[TaskResult]] = {}
    for result in results.tasks:
        tasks.setdefault(result.task, []).append(result)
    models = {entry.model for result in results.tasks for entry in result.entries}
    others = [result for result in results.tasks if result.split != HELD_OUT]
    splits = list(dict.fromkeys(result.split for result in others))
    sections = {"overview": "Overview"} | {anchor(task): capital(found[0].title) for task, found in tasks.items()}
    return page_html(
        "templates/benchmark.html.j2",
        __package__,
        title="Friction models compared",
        sections=sections | {"models": "Models", "budget": "Budget", "reading": "How to read the numbers"},
        counts=(len(models), len(tasks), len(results.tasks)),
        main_split=split_words(HELD_OUT),
        heat=heat_map([result for result in results.tasks if result.split == HELD_OUT], titles),
        other_heat=heat_map(sorted(others, key=lambda each: splits.index(each.split)), titles) if others else None,
        missing=[f"{capital(plain(task))}: {reason}" for task, reason in sorted(results.missing.items())],
        families=titles.legend(models),
        tasks=[_task(found, titles, findings.get(task, "")) for task, found in tasks.items()],
        models=_models(results, titles),
        budget=[(capital(plain(name)), _budget(value)) for name, value in sorted(results.budget.items())],
    )


def _task(results: Sequence[TaskResult], titles: ModelTitles, finding: str) -> dict[str, Any]:
    """Return what the page shows of one task: its question, the conclusion, and every split."""
    first = results[0]
    against = "the label" if first.reference == "label" else "true friction"
    reasons: dict[str, list[str]] = {}
    for result in results:
        for model, reason in sorted(result.missing.items()):
            reasons.setdefault(reason, []).append(titles(model))
    return {
        "anchor": anchor(first.task),
        "title": capital(first.title),
        "explanation": first.explanation,
        "inputs": ", ".join(first.inputs),
        "against": against,
        "baseline": titles(first.baseline),
        "finding": finding,
        "splits": [_split(result, titles) for result in results],
        "missing": [f"{', '.join(dict.fromkeys(names))}: {reason}" for reason, names in sorted(reasons.items())],
    }


def _split(result: TaskResult, titles: ModelTitles) -> dict[str, Any]:
    """Return one leaderboard's charts and tables; what was not computed is None."""
    label = result.label_truth_percent
    return {
        "words": capital(split_words(result.split)),
        "mean_n": of_size(result.mean_friction_n),
        "label": "" if label is None else f"{of_size(label.value)} % ({within(label)})",
        "label_drawn": charts.label_percent(result) is not None,
        "leaderboard": charts.leaderboard(result, titles),
        "cost_chart": charts.error_against_cost(result, titles),
        "errors": task_tables.error_table(result, titles),
        "motion": task_tables.motion_table(result, titles),
        "cost": task_tables.cost_table(result, titles),
        "tuning": task_tables.tuning_table(result, titles),
    }


def _models(results: BenchmarkResults, titles: ModelTitles) -> Table:
    rows: list[list[str | Cell]] = []
    for model in titles.by_family(sorted(results.models)):
        info = results.models[model]
        rows.append([Cell(info.title, small=model), info.family, info.source, info.chosen])
    return Table(["Model", "family", "source", "what was chosen"], rows, words=(1, 2, 3), sortable=True)


def _budget(value: float | int | str) -> str:
    return of_size(value) if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else value
