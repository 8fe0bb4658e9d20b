"""One leaderboard: answers read back, held beside the floor's, and put in order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.evaluation.bootstrap import block_sums, bootstrap_percent, interval
from friction_benchmark.data import exams_of, folds_of, unseen_kind
from friction_benchmark.flags import outside, taught_range
from friction_benchmark.folds import UNSEEN_RIG
from friction_benchmark.results import Interval
from friction_benchmark.scoring import Paper, entry_of
from friction_benchmark.storing import Store
from friction_benchmark.tasks import inputs_of, task_named

if TYPE_CHECKING:
    from friction_benchmark.results import Entry
    from friction_benchmark.running import Bench
    from friction_benchmark.scoring import ScoreSettings
    from friction_benchmark.storing import Answer
    from friction_benchmark.tasks import Exam, Task


def judged(bench: Bench, task_name: str, split: str, model: str, floor: str | None, how: ScoreSettings) -> Entry:
    """Return a model's line; ``floor`` is None where the floor itself has no answer."""
    task, store = task_named(task_name), Store(bench.store)
    answers = {seed: store.answer(task.name, split, model, seed) for seed in bench.seeds}
    floors = {} if floor is None else {seed: store.answer(task.name, split, floor, seed) for seed in bench.seeds}
    papers = [
        paper for seed in bench.seeds for paper in _papers(bench, task, split, seed, answers[seed], floors.get(seed))
    ]
    tuned = store.tuned(task.tuned_as or task.name, model)
    return entry_of(model, papers, list(answers.values()), tuned, bench.cylinder, how)


def denominators(bench: Bench, task: Task, split: str, how: ScoreSettings) -> tuple[float, Interval | None]:
    """Return mean |reference| [N] of the test recordings, and how far the label is from true friction, if known."""
    exams = [exam for seed in bench.seeds for exam in asked_of(bench, task, split, seed).values()]
    masks = [exam.recording.usable() for exam in exams]
    references = np.concatenate([exam.reference_n[mask] for exam, mask in zip(exams, masks, strict=True)])
    mean_n = float(np.abs(references).mean())
    truths = [exam.true_friction_n for exam in exams if exam.true_friction_n is not None]
    if len(truths) != len(exams):
        return mean_n, None
    rows = max(1, round(how.bootstrap_block_s / exams[0].recording.sample_time_s))
    sums = block_sums(truths, [exam.label_n for exam in exams], masks, rows)
    percent = 100.0 * float(sums.abs_error_n.sum() / sums.abs_friction_n.sum())
    return mean_n, Interval(percent, *interval(bootstrap_percent(sums, how.bootstrap_repeats, 0)))


def asked_of(bench: Bench, task: Task, split: str, seed: int) -> dict[str, Exam]:
    """Return the test recordings of a split, by name, in the order of its folds."""
    kind = unseen_kind(task) if split == UNSEEN_RIG else task.campaign
    exams = exams_of(bench.sources, task, kind, seed)
    return {name: exams[name] for fold in folds_of(bench.sources, task, split, seed) for name in fold.test}


def _papers(bench: Bench, task: Task, split: str, seed: int, answer: Answer, floor: Answer | None) -> list[Paper]:
    own = exams_of(bench.sources, task, task.campaign, seed)
    asked = asked_of(bench, task, split, seed)
    papers = []
    for fold in folds_of(bench.sources, task, split, seed):
        inputs = inputs_of(task, own[fold.train[0]].recording)
        known = taught_range(bench.sources, task, seed, fold.train, inputs, causal=False)
        for name in fold.test:
            floor_n = None if floor is None else floor.estimates[name].friction_n
            beyond = outside(known, asked[name].recording)
            papers.append(Paper(seed, asked[name], answer.estimates[name], floor_n, beyond))
    return papers
