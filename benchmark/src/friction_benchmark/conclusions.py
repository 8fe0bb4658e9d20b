"""What the benchmark found, in plain words made from the numbers alone: one paragraph a task."""

from collections.abc import Sequence

from friction_benchmark.folds import HELD_OUT
from friction_benchmark.report.model_titles import ModelTitles
from friction_benchmark.report.words import split_words, within
from friction_benchmark.results import NEEDS_MORE, BenchmarkResults, TaskResult

MOST_NAMES = 6


def findings_of(results: BenchmarkResults) -> dict[str, str]:
    """Return the paragraph of each task, by its name: who leads each split, by how much, who fails the baseline.

    A model counts as better than the baseline where the paired 95 % block-bootstrap interval of the difference excludes
    zero, and as tied with the best where its figure lies within the best one's interval.
    """
    titles = ModelTitles(results.models)
    tasks = list(dict.fromkeys(found.task for found in results.tasks))
    return {task: _paragraph([each for each in results.tasks if each.task == task], titles) for task in tasks}


def _paragraph(splits: Sequence[TaskResult], titles: ModelTitles) -> str:
    sentences = [sentence for found in splits for sentence in _standing(found, titles)]
    missing = {model: reason for found in splits for model, reason in found.missing.items()}
    failed = [model for model, reason in missing.items() if not reason.startswith(NEEDS_MORE)]
    if failed:
        sentences.append(f"Without a figure, because they failed: {_several(failed, titles)}.")
    return " ".join(sentences)


def _standing(found: TaskResult, titles: ModelTitles) -> list[str]:
    if not found.entries:
        return [f"On {split_words(found.split)}, no model has a figure."]
    best, percent = found.entries[0], found.entries[0].score.percent
    against = "true friction" if found.reference == "truth" else "the label"
    sentences = [
        f"On {split_words(found.split)}, {titles(best.model)} is nearest to {against}: {percent.value:.2f} % "
        f"({within(percent)}), {best.score.mae_n:.1f} N."
    ]
    tied = [entry.model for entry in found.entries[1:] if entry.score.percent.value <= percent.high]
    if tied:
        sentences.append(f"Within its interval, so that chance may decide: {_several(tied, titles)}.")
    return sentences + _against_baseline(found, titles, every=found.split == HELD_OUT)


def _against_baseline(found: TaskResult, titles: ModelTitles, *, every: bool) -> list[str]:
    """Return who beats the baseline; ``every``: and who does not."""
    baseline = found.entry_of(found.baseline)
    if baseline is None:
        return [f"The baseline, {titles(found.baseline)}, has no figure."]
    others = [entry for entry in found.entries if entry is not baseline]
    ahead = {entry.model: each for entry in others if (each := entry.below_baseline) is not None and each.low > 0.0}
    words = f"The baseline, {titles(baseline.model)}, has {baseline.score.percent.value:.2f} %"
    if not ahead:
        return [f"{words}, and no model beats it outside the bootstrap interval."]
    first, points = next(iter(ahead.items()))
    sentences = [
        f"{words}; {titles(first)} is {points.value:.2f} percentage points below it ({within(points)}), as "
        f"{len(ahead)} of {len(others)} models are by some amount."
    ]
    worse = [entry.model for entry in others if entry.model not in ahead]
    return [*sentences, f"It is not beaten by {_several(worse, titles)}."] if every and worse else sentences


def _several(models: Sequence[str], titles: ModelTitles) -> str:
    more = [f"and {len(models) - MOST_NAMES} more"] if len(models) > MOST_NAMES else []
    return "; ".join([*map(titles, models[:MOST_NAMES]), *more])
