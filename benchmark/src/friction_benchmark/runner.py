"""The whole benchmark: recordings, tunings, predictions, scores; each phase shared among processes, each job cached."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter

from cylinder_friction.execution.progress import progress
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.execution.workers import LostPiece, Work
from friction_benchmark.campaigns import simulate
from friction_benchmark.cases import Task
from friction_benchmark.datasets import Kind, Sources, folds_of, inputs_of, labelled_recordings, twin_kind, unseen_kind
from friction_benchmark.folds import UNSEEN_RIG
from friction_benchmark.jobs import WORKER, Context, Job, code_key, model_code, tuning_job
from friction_benchmark.leaderboard import ScoringJob, denominators
from friction_benchmark.plan import Plan
from friction_benchmark.results import NEEDS_MORE, BenchmarkResults, Entry, ModelInfo, TaskResult
from friction_benchmark.scoring import ScoreSettings
from friction_benchmark.tasks import task_named
from friction_benchmark.tuning import Tuned
from friction_benchmark.worker import do_jobs, do_tuning

SCORER = "friction_benchmark.leaderboard"
ENTRY = TypeAdapter(Entry)
Item = TypeVar("Item")


@dataclass
class Runner:
    """One run of the benchmark; the number of workers and their order change nothing but times."""

    plan: Plan  # What is evaluated
    sources: Sources  # Where the recordings are
    cache: Path  # Folder in which all that is computed is kept
    settings: ScoreSettings  # How predictions are scored
    workers: int = 1  # Processes, where ``CYLINDER_FRICTION_WORKERS`` names no other workers
    computed: Counter[str] = field(default_factory=Counter)  # How many jobs of each kind were not in the cache

    def run(self) -> BenchmarkResults:
        """Return what the benchmark found."""
        self.models = self.plan.chosen_models()
        self.context = Context(self.sources, self.cache, self.plan.effort, code_key(WORKER))
        codes = {module: model_code(module) for module in {model.module for model in self.models.values()}}
        self.codes = {name: codes[model.module] for name, model in self.models.items()}
        self.tuned: dict[tuple[str, str], Tuned | str] = {}
        self.predictions: dict[tuple[Task, str, str, int], tuple[str, ...]] = {}
        self.failures: dict[tuple[Task, str, str, int], dict[int, str]] = {}
        with workers_from_environment(self.workers) as self.processes:
            self._simulate()
            self.leaderboards, missing = self.plan.leaderboards(self.sources)
            self._tune()
            self._predict()
            scores = self._score()
        return BenchmarkResults(
            tasks=tuple(self._task_result(task, split, scores) for task, split in self.leaderboards),
            models={
                name: ModelInfo(model.title, model.family, model.source, model.chosen)
                for name, model in self.models.items()
            },
            budget=self._budget(),
            missing=missing,
        )

    def _simulate(self) -> None:
        kinds: set[Kind] = set()
        for task in map(task_named, self.plan.tasks):
            if self.sources.simulated:
                kinds.add(task.campaign)
                if task.name in self.plan.splits.get(UNSEEN_RIG, ()):
                    kinds.add(unseen_kind(task))
            if any(model.trained_on == "twin" for model in self.models.values()):
                kinds.add(twin_kind(task))
        campaigns = [(kind, seed) for kind in sorted(kinds) for seed in self.plan.seeds]
        new = [each for each in campaigns if not self.sources.campaign_folder(*each).is_dir()]
        for each, done in self._done("campaigns", new, lambda each: partial(simulate, self.sources, *each)):
            self.computed["campaigns"] += 1
            if isinstance(done, LostPiece):
                raise RuntimeError(f"simulation of {each}: {done.reason}")
        for each in campaigns:
            self.sources.campaign_folder(*each).touch()

    def _tune(self) -> None:
        """Fill ``tuned`` with what was chosen, or why nothing was, by model and task."""
        names = dict.fromkeys(task.tuned_as or task.name for task, _ in self.leaderboards)
        jobs, trials = [], self.plan.trials
        for model in reversed(self.models.values()):
            for task in [task for task in map(task_named, names) if model.supports(self._inputs(task))]:
                self.tuned[model.name, task.name] = Tuned(model.defaults, None)
                if model.space:
                    jobs.append(tuning_job(model, task, self.plan.seeds[0], self.codes[model.name]))
        for job, done in self._done("tunings", jobs, lambda job: partial(do_tuning, self.context, job, trials)):
            tuned, computed = (done.reason, 0) if isinstance(done, LostPiece) else done
            self.tuned[job.model.name, job.task.name] = tuned
            self.computed["trials"] += computed

    def _predict(self) -> None:
        """Fill ``predictions`` with keys, ``failures`` with reasons; one piece of work is a fit and its predictions."""
        groups: dict[tuple[str, ...], list[Job]] = {}
        for model in reversed(self.models.values()):
            for task, split in self.leaderboards:
                tuned = self.tuned.get((model.name, task.tuned_as or task.name))
                if not isinstance(tuned, Tuned):
                    continue
                for seed in self.plan.seeds:
                    code, folds = self.codes[model.name], len(folds_of(self.sources, task, split, seed))
                    jobs = [Job(model, task, split, fold, seed, tuned.choice, code) for fold in range(folds)]
                    keys = tuple(job.key(self.context) for job in jobs)
                    self.predictions[task, split, model.name, seed] = keys
                    for job, key in zip(jobs, keys, strict=True):
                        if not self.context.cache.has_prediction(key):
                            groups.setdefault(job.shared_fit(), []).append(job)
        for job, problem in self._predicted(list(groups.values())):
            self.computed["predictions"] += 1
            if problem:
                by_fold = self.failures.setdefault((job.task, job.split, job.model.name, job.seed), {})
                by_fold[job.fold] = f"seed {job.seed}: {problem}"

    def _score(self) -> dict[tuple[str, str], list[Entry]]:
        """Return the lines of each leaderboard, best first."""
        code = code_key(SCORER)
        jobs: list[ScoringJob] = []
        for task, split in self.leaderboards:
            scored, seeds = [name for name in self.models if not self._why_missing(task, split, name)], self.plan.seeds
            keys = {name: {seed: self.predictions[task, split, name, seed] for seed in seeds} for name in scored}
            for name in scored:
                tuned = self.tuned[name, task.tuned_as or task.name]
                assert isinstance(tuned, Tuned)
                baseline = keys.get(task.baseline, {})
                jobs.append(ScoringJob(name, task, split, keys[name], baseline, tuned, self.settings, code))
        new = [job for job in jobs if self.context.cache.score(job.key()) is None]
        for job, done in self._done("scores", new, lambda job: partial(job.do, self.context)):
            self.computed["scores"] += 1
            if isinstance(done, LostPiece):
                raise RuntimeError(f"scoring of {job.model} on {job.task.name}: {done.reason}")
        lines: dict[tuple[str, str], list[Entry]] = {}
        for job in jobs:
            entry = ENTRY.validate_python(self.context.cache.score(job.key()))
            lines.setdefault((job.task.name, job.split), []).append(entry)
        for line in lines.values():
            line.sort(key=lambda entry: (entry.score.percent.value, entry.model))
        return lines

    def _task_result(self, task: Task, split: str, scores: dict[tuple[str, str], list[Entry]]) -> TaskResult:
        mean_n, label = denominators(self.context, task, split, self.plan.seeds, self.settings)
        reasons = {name: self._why_missing(task, split, name) for name in self.models}
        return TaskResult(
            task=task.name,
            split=split,
            title=task.title,
            inputs=self._inputs(task),
            reference=task.reference,
            baseline=task.baseline,
            mean_friction_n=mean_n,
            entries=tuple(scores.get((task.name, split), ())),
            missing={name: reason for name, reason in reasons.items() if reason},
            explanation=task.explanation,
            label_truth_percent=label,
        )

    def _why_missing(self, task: Task, split: str, name: str) -> str:
        """Return why a model has no line in a leaderboard; empty where it has one."""
        inputs = self._inputs(task)
        if not self.models[name].supports(inputs):
            return f"{NEEDS_MORE} {', '.join(inputs)}"
        tuned = self.tuned[name, task.tuned_as or task.name]
        if isinstance(tuned, str):
            return tuned
        failures = (self.failures.get((task, split, name, seed), {}) for seed in self.plan.seeds)
        return next((by_fold[min(by_fold)] for by_fold in failures if by_fold), "")

    def _inputs(self, task: Task) -> tuple[str, ...]:
        return inputs_of(self.sources, task, self.plan.seeds[0])

    def _budget(self) -> dict[str, float | int | str]:
        """Return what was spent, in numbers and words; recordings are those of the first task."""
        campaign = task_named(self.plan.tasks[0]).campaign
        labelled = labelled_recordings(self.sources, campaign, self.plan.seeds[0])
        recordings = [each.recording for each in labelled.values()]
        return {
            "trials": self.plan.trials,
            "effort": self.plan.effort,
            "seeds": len(self.plan.seeds),
            "recordings": len(recordings),
            "seconds_a_recording": max(len(each) * each.sample_time_s for each in recordings),
            "source": "simulated campaigns" if self.sources.simulated else "own recordings",
        }

    def _predicted(self, groups: list[list[Job]]) -> Iterator[tuple[Job, str]]:
        """Yield every job and why it failed, empty where it did not; of a group whose process died, one by one."""
        for group, done in self._done("predictions", groups, lambda group: partial(do_jobs, self.context, group)):
            if not isinstance(done, LostPiece):
                yield from zip(group, done, strict=True)
            elif len(group) == 1:
                yield group[0], done.reason
            else:
                yield from self._predicted([[job] for job in group])

    def _done(self, kind: str, items: Sequence[Item], work: Callable[[Item], Work]) -> Iterator[tuple[Item, Any]]:
        """Yield each item and the result of its work, as they finish, with a progress bar."""
        done = self.processes.do_all([work(item) for item in items])
        for number, result in progress(done, kind, len(items), unit="job"):
            yield items[number], result
