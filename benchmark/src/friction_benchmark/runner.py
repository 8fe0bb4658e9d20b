"""The whole benchmark: recordings, tunings, predictions, scores; each phase shared among processes, each job cached."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.execution.workers import Died
from friction_benchmark.campaigns import simulate
from friction_benchmark.cases import Task
from friction_benchmark.datasets import Kind, Sources, folds_of, inputs_of, labelled_recordings, twin_kind, unseen_kind
from friction_benchmark.folds import UNSEEN_RIG
from friction_benchmark.jobs import WORKER, Context, Job, model_code, tuning_job
from friction_benchmark.leaderboard import ScoringJob, denominators
from friction_benchmark.plan import Plan
from friction_benchmark.results import NEEDS_MORE, BenchmarkResults, Entry, ModelInfo, TaskResult
from friction_benchmark.scoring import ScoreSettings
from friction_benchmark.source_code import code_key
from friction_benchmark.tasks import task_named
from friction_benchmark.tuning import Tuned
from friction_benchmark.worker import do_jobs, do_tuning

SCORER = "friction_benchmark.leaderboard"


@dataclass
class Runner:
    """One run of the benchmark; the number of workers and their order change nothing but times."""

    plan: Plan  # What is evaluated
    sources: Sources  # Where the recordings are
    cache: Path  # Folder in which all that is computed is kept
    settings: ScoreSettings  # How predictions are scored
    workers: int = 1  # Processes, where ``CYLINDER_FRICTION_WORKERS`` names no other workers
    progress: bool | None = None  # Whether bars are drawn; None for only on a terminal
    computed: Counter[str] = field(default_factory=Counter)  # How many jobs of each kind were not in the cache

    def run(self) -> BenchmarkResults:
        """Return what the benchmark found.

        Raises:
            ValueError: A task is not known.
            ParamsError: A model is not in the registry.
        """
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
        work = [partial(simulate, self.sources, *each) for each in new]
        for number, done in self._all_of(work, [1] * len(work), "campaigns"):
            self.computed["campaigns"] += 1
            if isinstance(done, Died):
                raise RuntimeError(f"simulation of {new[number]}: {done.reason}")
        for each in campaigns:
            self.sources.campaign_folder(*each).touch()

    def _tune(self) -> None:
        """Fill ``tuned`` with what was chosen, or why nothing was, by model and task."""
        names = dict.fromkeys(task.tuned_as or task.name for task, _ in self.leaderboards)
        jobs = []
        for model in reversed(self.models.values()):
            for task in [task for task in map(task_named, names) if model.supports(self._inputs(task))]:
                self.tuned[model.name, task.name] = Tuned(model.defaults, None)
                if model.space:
                    jobs.append(tuning_job(model, task, self.plan.seeds[0], self.codes[model.name]))
        work = [partial(do_tuning, self.context, job, self.plan.trials) for job in jobs]
        for number, done in self._all_of(work, [self.plan.trials] * len(jobs), "trials"):
            tuned, computed = (done.reason, 0) if isinstance(done, Died) else done
            self.tuned[jobs[number].model.name, jobs[number].task.name] = tuned
            self.computed["trials"] += computed

    def _predict(self) -> None:
        """Fill ``predictions`` with their keys, and ``failures`` with why there is none.

        One piece of work is one fit, and all that is predicted with it.
        """
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
        for job, problem in self._done(list(groups.values())):
            self.computed["predictions"] += 1
            if problem:
                by_fold = self.failures.setdefault((job.task, job.split, job.model.name, job.seed), {})
                by_fold[job.fold] = f"seed {job.seed}: {problem}"

    def _score(self) -> dict[tuple[str, str], list[Entry]]:
        """Return the lines of each leaderboard, best first."""
        code = code_key(SCORER)
        jobs: list[ScoringJob] = []
        for task, split in self.leaderboards:
            scored = [name for name in self.models if not self._why_missing(task, split, name)]
            keys = {
                name: {seed: self.predictions[task, split, name, seed] for seed in self.plan.seeds} for name in scored
            }
            for name in scored:
                tuned = self.tuned[name, task.tuned_as or task.name]
                assert isinstance(tuned, Tuned)
                baseline = keys.get(task.baseline, {})
                jobs.append(ScoringJob(name, task, split, keys[name], baseline, tuned, self.settings, code))
        new = [job for job in jobs if self.context.cache.score(job.key()) is None]
        work = [partial(job.do, self.context) for job in new]
        for number, done in self._all_of(work, [1] * len(new), "scores"):
            self.computed["scores"] += 1
            if isinstance(done, Died):
                raise RuntimeError(f"scoring of {new[number].model} on {new[number].task.name}: {done.reason}")
        lines: dict[tuple[str, str], list[Entry]] = {}
        for job in jobs:
            entry = Entry.from_dict(self.context.cache.score(job.key()))
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

    def _done(self, groups: list[list[Job]]) -> Iterator[tuple[Job, str]]:
        """Yield every job and why it failed, empty where it did not; of a group whose process died, one by one."""
        work = [partial(do_jobs, self.context, group) for group in groups]
        for number, done in self._all_of(work, [len(group) for group in groups], "predictions"):
            if not isinstance(done, Died):
                yield from zip(groups[number], done, strict=True)
            elif len(groups[number]) == 1:
                yield groups[number][0], done.reason
            else:
                alone = [partial(do_jobs, self.context, [job]) for job in groups[number]]
                for one, result in self.processes.do_all(alone):
                    yield groups[number][one], done.reason if isinstance(result, Died) else result[0]

    def _all_of(self, work: Sequence[Callable[[], Any]], sizes: Sequence[int], kind: str) -> Iterator[tuple[int, Any]]:
        """Yield the number of each piece of work and its result, as they finish."""
        hidden = None if self.progress is None else not self.progress
        with tqdm(total=sum(sizes), desc=kind, unit="job", disable=hidden) as bar:
            for number, result in self.processes.do_all(work):
                yield number, result
                bar.update(sizes[number])
