"""What the benchmark found, in plain words made from the numbers alone: one paragraph a task."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.folds import HELD_OUT, SPLITS, UNSEEN_RIG
from friction_benchmark.results import NEEDS_MORE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from friction_benchmark.results import BenchmarkResults, Entry, ModelInfo, TaskResult

AIM = (0.87, 0.93)
"""Between these the coverage of a 90 % interval should lie in every condition."""
MOST_NAMES = 6
WORTH_COMPARING = 1.5
"""A model that is farther from truth than the label by more than this is not in its league."""
LEVEL = 0.99
"""Nearer together than this counts as level."""


def findings_of(results: BenchmarkResults) -> dict[str, str]:
    """Return the paragraph of each task, by its name: who wins, by how much, who does not beat the baseline.

    A model counts as better than the baseline where the paired 95 % block-bootstrap interval of the difference excludes
    zero, and as tied with the best where its figure lies within the best one's interval.
    """
    tasks = list(dict.fromkeys(found.task for found in results.tasks))
    return {task: _paragraph([found for found in results.tasks if found.task == task], results) for task in tasks}


def _paragraph(splits: Sequence[TaskResult], results: BenchmarkResults) -> str:
    titles = _Titles(results.models)
    sentences: list[str] = []
    for found in splits:
        if not found.entries:
            sentences.append(f"On {SPLITS[found.split]}, no model has a figure.")
        elif found.split == HELD_OUT:
            sentences += _standing(found, titles)
            sentences += _families(found, titles)
            sentences += _truth(found, titles)
            sentences += _load(found, titles)
            sentences += _coverage(found, titles)
        else:
            sentences += _elsewhere(found, splits[0], titles)
    failed = {
        model: reason
        for found in splits
        for model, reason in found.missing.items()
        if not reason.startswith(NEEDS_MORE)
    }
    if failed:
        sentences.append(f"Without a figure, because they failed: {titles.several(list(failed))}.")
    return " ".join(sentences)


class _Titles:
    def __init__(self, models: Mapping[str, ModelInfo]) -> None:
        self.models = models

    def __call__(self, model: str) -> str:
        return self.models[model].title if model in self.models else model

    def family(self, model: str) -> str:
        return self.models[model].family if model in self.models else ""

    def several(self, models: Sequence[str]) -> str:
        names = [self(model) for model in models[:MOST_NAMES]]
        if len(models) > MOST_NAMES:
            return f"{'; '.join(names)}; and {len(models) - MOST_NAMES} more"
        return names[0] if len(names) == 1 else f"{'; '.join(names[:-1])}; and {names[-1]}"


def _standing(found: TaskResult, titles: _Titles) -> list[str]:
    best = found.entries[0]
    against = "true friction" if found.reference == "truth" else "the label"
    sentences = [f"On {SPLITS[found.split]}, {titles(best.model)} is nearest to {against}: {_figure(best)}."]
    tied = [entry.model for entry in found.entries[1:] if entry.score.percent.value <= best.score.percent.high]
    if tied:
        verb = "lies" if len(tied) == 1 else "lie"
        sentences.append(f"{titles.several(tied)} {verb} within its interval, so chance may decide between them.")
    baseline = next((entry for entry in found.entries if entry.model == found.baseline), None)
    if baseline is None:
        return [*sentences, f"The baseline, {titles(found.baseline)}, has no figure."]
    return sentences + _against_baseline(found, baseline, titles)


def _against_baseline(found: TaskResult, baseline: Entry, titles: _Titles) -> list[str]:
    others = [entry for entry in found.entries if entry.model != baseline.model]
    better = [entry for entry in others if entry.below_baseline is not None and entry.below_baseline.low > 0.0]
    worse = [entry for entry in others if entry not in better]
    words = f"The baseline, {titles(baseline.model)}, has {baseline.score.percent.value:.2f} %"
    if not better:
        return [f"{words}, and no model beats it outside the bootstrap interval."]
    best = better[0]
    assert best.below_baseline is not None
    ahead = best.below_baseline
    sentences = [
        f"{words}; {titles(best.model)} is {ahead.value:.2f} percentage points below it "
        f"({ahead.low:.2f} to {ahead.high:.2f}), as {_count(len(better))} of {len(others)} models are by some amount."
    ]
    if worse:
        verb = "does" if len(worse) == 1 else "do"
        sentences.append(f"{titles.several([entry.model for entry in worse])} {verb} not beat the baseline.")
    return sentences


def _families(found: TaskResult, titles: _Titles) -> list[str]:
    best: dict[str, Entry] = {}
    for entry in found.entries:
        best.setdefault(titles.family(entry.model), entry)
    named = [
        f"{family}, {titles(best[family].model)} with {best[family].score.percent.value:.2f} %"
        for family in ("analytical", "related work", "modern")
        if family in best
    ]
    return [f"The best of each family: {'; '.join(named)}."] if len(named) > 1 else []


def _truth(found: TaskResult, titles: _Titles) -> list[str]:
    """Return who is nearest to true friction, and whether nearer than the label that models are trained on."""
    known = [entry for entry in found.entries if "truth_percent" in entry.extras]
    if not known or found.label_truth_percent is None:
        return []
    nearest = min(known, key=lambda entry: (entry.extras["truth_percent"], entry.model))
    label = found.label_truth_percent.value
    own = nearest.extras["truth_percent"]
    if found.reference == "truth":
        return [f"The off-line label, which looks ahead, is {label:.2f} % from true friction."]
    if own > WORTH_COMPARING * label:
        return []
    relation = "nearer than" if own < LEVEL * label else "about as near as" if own < label / LEVEL else "farther than"
    return [
        f"From true friction {titles(nearest.model)} is {own:.2f} % away, {relation} the off-line label itself "
        f"({label:.2f} %)."
    ]


def _load(found: TaskResult, titles: _Titles) -> list[str]:
    known = [entry for entry in found.entries if "load_mae_n" in entry.extras]
    if not known:
        return []
    nearest = min(known, key=lambda entry: (entry.extras["load_mae_n"], entry.model))
    share = f" ({nearest.extras['load_percent']:.1f} % of its mean)" if "load_percent" in nearest.extras else ""
    return [
        f"As a virtual load cell {titles(nearest.model)} does best: {nearest.extras['load_mae_n']:.0f} N off the true "
        f"load on average{share}."
    ]


def _coverage(found: TaskResult, titles: _Titles) -> list[str]:
    trusted = [(entry, entry.trust) for entry in found.entries if entry.trust is not None]
    if not trusted:
        return []
    best, trust = trusted[0]
    tests = [value for test, value in trust.coverage.items() if test]
    good = sum(
        all(AIM[0] <= round(value, 3) <= AIM[1] for test, value in each.coverage.items() if test) for _, each in trusted
    )
    sentences = [
        f"The 90 % bounds of {titles(best.model)} hold {100.0 * min(tests):.1f} to {100.0 * max(tests):.1f} % of the "
        f"labels by condition and {100.0 * trust.coverage_after_reversal:.1f} % just after reversals; "
        f"{_count(good)} of {len(trusted)} models keep to 87 to 93 % in every condition."
    ]
    if found.reference == "truth" and trust.coverage_of_truth is not None:
        sentences.append(f"Of true friction they hold {100.0 * trust.coverage_of_truth:.1f} %.")
    return sentences


def _elsewhere(found: TaskResult, base: TaskResult, titles: _Titles) -> list[str]:
    best = found.entries[0]
    sentences = [f"On {SPLITS[found.split]}, {titles(best.model)} leads with {_figure(best)}"]
    held = base.entries[0] if base.entries else None
    if held is not None and held.model != best.model:
        same = next((entry for entry in found.entries if entry.model == held.model), None)
        if same is not None:
            sentences[0] += f", where {titles(held.model)} has {same.score.percent.value:.2f} %"
    sentences[0] += "."
    if best.below_baseline is None or (best.model != found.baseline and best.below_baseline.low <= 0.0):
        sentences.append("There it does not beat the baseline outside the interval.")
    elif best.model == found.baseline:
        sentences.append("That is the baseline: nothing beats it there.")
    if found.split == UNSEEN_RIG:
        sentences += _truth(found, titles)
        if best.trust is not None and best.trust.caught is not None:
            sentences.append(
                f"{100.0 * best.trust.outside:.1f} % of its rows lie outside the training range, and its flag "
                f"fires on {100.0 * best.trust.caught:.1f} % of them."
            )
    return sentences


def _figure(entry: Entry) -> str:
    percent = entry.score.percent
    return f"{percent.value:.2f} % ({percent.low:.2f} to {percent.high:.2f}), {entry.score.mae_n:.1f} N"


def _count(number: int) -> str:
    return "none" if number == 0 else str(number)
