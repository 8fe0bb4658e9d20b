"""One leaderboard: predictions read back and held beside the baseline's; each of its lines is a job of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from friction_benchmark.bootstrap import block_sums, bootstrap_percent, interval
from friction_benchmark.cases import EvaluationCase, Task
from friction_benchmark.datasets import cases_of, folds_of, key_of, unseen_kind
from friction_benchmark.folds import UNSEEN_RIG
from friction_benchmark.jobs import Context
from friction_benchmark.results import Interval
from friction_benchmark.scoring import ScoredRecording, ScoreSettings, leaderboard_entry
from friction_benchmark.tuning import Tuned


@dataclass(frozen=True)
class ScoringJob:
    """One line of a leaderboard."""

    model: str  # Its name
    task: Task
    split: str
    predictions: Mapping[int, tuple[str, ...]]  # Keys of its predictions, one per fold, by seed
    baseline: Mapping[int, tuple[str, ...]]  # Those of the baseline; empty where the baseline failed
    tuned: Tuned  # What was chosen
    settings: ScoreSettings  # How to score
    code: str  # Hash of the code that scores

    def key(self) -> str:
        settings = self.settings.model_dump()
        return key_of({**asdict(self), "task": self.task.name, "settings": settings})

    def do(self, context: Context) -> None:
        """Score the model and keep the line in the cache."""
        scored: list[ScoredRecording] = []
        predictions = [context.cache.predictions(keys) for keys in self.predictions.values()]
        for seed, prediction in zip(self.predictions, predictions, strict=True):
            baseline = context.cache.predictions(self.baseline[seed]).estimates if self.baseline else {}
            for name, case in tested_cases(context, self.task, self.split, seed).items():
                beside_n = baseline[name].friction_n if baseline else None
                scored.append(ScoredRecording(seed, case, prediction.estimates[name], beside_n))
        entry = leaderboard_entry(self.model, scored, predictions, self.tuned, context.sources.cylinder, self.settings)
        context.cache.keep_score(self.key(), asdict(entry))


def denominators(
    context: Context, task: Task, split: str, seeds: Sequence[int], settings: ScoreSettings
) -> tuple[float, Interval | None]:
    """Return mean |reference| [N] of the test recordings, and how far the label is from true friction, if known."""
    cases = [case for seed in seeds for case in tested_cases(context, task, split, seed).values()]
    masks = [case.usable for case in cases]
    references = np.concatenate([case.reference_n[mask] for case, mask in zip(cases, masks, strict=True)])
    mean_n = float(np.abs(references).mean())
    truths = [case.true_friction_n for case in cases if case.true_friction_n is not None]
    if len(truths) != len(cases):
        return mean_n, None
    rows = settings.block_rows(cases[0].recording.sample_time_s)
    sums = block_sums(truths, [case.label_n for case in cases], masks, rows)
    return mean_n, Interval(sums.percent, *interval(bootstrap_percent(sums, settings.bootstrap_repeats, 0)))


def tested_cases(context: Context, task: Task, split: str, seed: int) -> dict[str, EvaluationCase]:
    """Return the test recordings of a split, by name, in the order of its folds."""
    kind = unseen_kind(task) if split == UNSEEN_RIG else task.campaign
    cases = cases_of(context.sources, task, kind, seed)
    return {name: cases[name] for fold in folds_of(context.sources, task, split, seed) for name in fold.test}
