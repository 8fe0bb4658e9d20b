"""The whole benchmark: recordings, tuning, answers, scores; each phase shared among processes."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from friction_benchmark.data import cases_of, simulate_campaign, twin_kind, unseen_kind
from friction_benchmark.folds import HELD_OUT, LEAVE_LOAD, LEAVE_TEMPERATURE, UNSEEN_RIG
from friction_benchmark.judging import denominators, judged
from friction_benchmark.pool import Died, Workers
from friction_benchmark.programme import Programme, problem_of
from friction_benchmark.registry.listing import registered_models
from friction_benchmark.results import BenchmarkResults, ModelInfo, TaskResult
from friction_benchmark.running import Question, answer_questions, tune_model
from friction_benchmark.tasks import inputs_of, task_named

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from friction_benchmark.data import Kind
    from friction_benchmark.pool import Work
    from friction_benchmark.registry.model import RegisteredModel
    from friction_benchmark.results import Entry
    from friction_benchmark.running import Bench, Failures
    from friction_benchmark.scoring import ScoreSettings
    from friction_benchmark.tasks import Task


@dataclass
class _Course:
    """What is known so far: what can be asked, what failed, and why."""

    asked: list[tuple[Task, str]] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    untuned: dict[tuple[str, str], str] = field(default_factory=dict)
    failures: Failures = field(default_factory=dict)


@dataclass(frozen=True)
class _Work:
    """Who works, and whether a bar shows it."""

    processes: Workers
    progress: bool

    def done(self, pieces: Sequence[Work], sizes: Sequence[int], words: str, unit: str) -> Iterator[tuple[int, Any]]:
        with tqdm(total=sum(sizes), desc=words, unit=unit, disable=not self.progress) as bar:
            for number, result in self.processes.do_all(pieces):
                yield number, result
                bar.update(sizes[number])


def run_benchmark(
    bench: Bench, programme: Programme, how: ScoreSettings, workers: int, progress: bool = True
) -> BenchmarkResults:
    """Return what the benchmark found; the number of workers and their order change nothing but times.

    Raises:
        ValueError: A task, split or model is not known.
    """
    entries = _participants(bench, programme)
    course = _Course()
    with Workers(workers) as processes:
        work = _Work(processes, progress)
        _simulate(bench, programme, entries, work)
        _choose(bench, programme, course)
        _tune(bench, course, entries, work)
        _answer(bench, course, entries, work)
        lines = _judge(bench, course, entries, how, work)
    return BenchmarkResults(
        tasks=tuple(_task_result(bench, course, entries, how, *pair, lines) for pair in course.asked),
        models={
            name: ModelInfo(entry.title, entry.family, entry.source, entry.chosen) for name, entry in entries.items()
        },
        budget=_budget(bench),
        missing=course.missing,
    )


def _participants(bench: Bench, programme: Programme) -> dict[str, RegisteredModel]:
    known = registered_models(bench.modules)
    for name in programme.models:
        if name not in known:
            raise ValueError(f"no participant {name!r}; expected some of {', '.join(known)}")
    return {name: entry for name, entry in known.items() if name in programme.models or not programme.models}


def _simulate(bench: Bench, programme: Programme, entries: Mapping[str, RegisteredModel], work: _Work) -> None:
    kinds: set[Kind] = set()
    for name in programme.tasks:
        task = task_named(name)
        if bench.sources.simulated:
            kinds.add(task.campaign)
            if name in programme.splits.get(UNSEEN_RIG, ()):
                kinds.add(unseen_kind(task))
        if any(entry.trained_on == "twin" for entry in entries.values()):
            kinds.add(twin_kind(task))
    pieces: list[Work] = [
        partial(simulate_campaign, bench.sources, bench.cylinder, kind, seed)
        for kind in sorted(kinds)
        for seed in bench.seeds
    ]
    for _, done in work.done(pieces, [1] * len(pieces), "simulate", "campaign"):
        if isinstance(done, Died):
            raise RuntimeError(f"simulate: {done.reason}")


def _choose(bench: Bench, programme: Programme, course: _Course) -> None:
    """Notes which tasks and splits these recordings allow."""
    for name in programme.tasks:
        task = task_named(name)
        if task.needs_truth and not bench.sources.simulated:
            course.missing[name] = "it is judged against true friction, which nobody knows of one's own recordings"
            continue
        course.asked.append((task, HELD_OUT))
    for split, names in programme.splits.items():
        for task, _ in [pair for pair in course.asked if pair[0].name in names and pair[1] == HELD_OUT]:
            problem = problem_of(bench, task, split)
            if problem:
                course.missing[f"{task.name}, {split}"] = problem
            else:
                course.asked.append((task, split))


def _tune(bench: Bench, course: _Course, entries: Mapping[str, RegisteredModel], work: _Work) -> None:
    names = list(dict.fromkeys(task.tuned_as or task.name for task, _ in course.asked))
    pieces: list[Work] = []
    about: list[tuple[str, list[str]]] = []
    for entry in reversed(list(entries.values())):
        tasks = [name for name in names if entry.space and entry.supports(_inputs(bench, task_named(name)))]
        if tasks:
            pieces.append(partial(tune_model, bench, entry.name, tuple(tasks)))
            about.append((entry.name, tasks))
    for number, done in work.done(pieces, [len(tasks) for _, tasks in about], "tune", "task"):
        model, tasks = about[number]
        failed = dict.fromkeys(tasks, done.reason) if isinstance(done, Died) else done
        course.untuned |= {(model, task): reason for task, reason in failed.items()}


def _answer(
    bench: Bench,
    course: _Course,
    entries: Mapping[str, RegisteredModel],
    work: _Work,
) -> None:
    """One piece is one model and seed on recordings of one kind: what it shares in fits stays with one worker."""
    groups: dict[tuple[str, int, str], list[Question]] = {}
    for model in reversed(list(entries)):
        for task, split in course.asked:
            if _excuse(bench, course, entries[model], task):
                continue
            for seed in bench.seeds:
                left_out = split if split in (LEAVE_LOAD, LEAVE_TEMPERATURE) else ""
                group = groups.setdefault((model, seed, f"{task.campaign} {left_out}"), [])
                group.append(Question(task.name, split, model, seed))
    questions = list(groups.values())
    pieces: list[Work] = [partial(answer_questions, bench, tuple(group)) for group in questions]
    sizes = [len(group) for group in questions]
    for number, done in work.done(pieces, sizes, "answer", "question"):
        if isinstance(done, Died):
            # One question killed the process; those that were finished before it count.
            done = _one_by_one(bench, questions[number], done, work)
        course.failures |= done


def _one_by_one(bench: Bench, questions: Sequence[Question], died: Died, work: _Work) -> Failures:
    failures: Failures = {}
    for question in questions:
        for _, done in work.processes.do_all([partial(answer_questions, bench, (question,))]):
            failures |= {question: died.reason} if isinstance(done, Died) else done
    return failures


Lines = dict[tuple[str, str], list["Entry"]]


def _judge(
    bench: Bench,
    course: _Course,
    entries: Mapping[str, RegisteredModel],
    how: ScoreSettings,
    work: _Work,
) -> Lines:
    pieces: list[Work] = []
    about: list[tuple[str, str]] = []
    for task, split in course.asked:
        good = [
            model
            for model, entry in entries.items()
            if not _excuse(bench, course, entry, task) and not _failure(course, task, split, model, bench.seeds)
        ]
        floor = task.baseline if task.baseline in good else None
        for model in good:
            pieces.append(partial(judged, bench, task.name, split, model, floor, how))
            about.append((task.name, split))
    lines: Lines = {}
    for number, done in work.done(pieces, [1] * len(pieces), "judge", "model"):
        if isinstance(done, Died):
            raise RuntimeError(f"judge {about[number]}: {done.reason}")
        lines.setdefault(about[number], []).append(done)
    return lines


def _task_result(
    bench: Bench,
    course: _Course,
    entries: Mapping[str, RegisteredModel],
    how: ScoreSettings,
    task: Task,
    split: str,
    lines: Lines,
) -> TaskResult:
    missing: dict[str, str] = {}
    for model, entry in entries.items():
        reason = _excuse(bench, course, entry, task) or _failure(course, task, split, model, bench.seeds)
        if reason:
            missing[model] = reason
    mean_n, label = denominators(bench, task, split, how)
    best_first = sorted(lines.get((task.name, split), []), key=lambda entry: (entry.score.percent.value, entry.model))
    return TaskResult(
        task=task.name,
        split=split,
        title=task.title,
        inputs=_inputs(bench, task),
        reference=task.reference,
        baseline=task.baseline,
        mean_friction_n=mean_n,
        entries=tuple(best_first),
        missing=missing,
        explanation=task.explanation,
        label_truth_percent=label,
    )


def _excuse(bench: Bench, course: _Course, entry: RegisteredModel, task: Task) -> str:
    """Return why a participant does not take part in a task; empty where it does."""
    inputs = _inputs(bench, task)
    if not entry.supports(inputs):
        return f"it needs more than {', '.join(inputs)}"
    return course.untuned.get((entry.name, task.tuned_as or task.name), "")


def _failure(course: _Course, task: Task, split: str, model: str, seeds: Sequence[int]) -> str:
    for seed in seeds:
        reason = course.failures.get(Question(task.name, split, model, seed))
        if reason:
            return f"seed {seed}: {reason}"
    return ""


def _inputs(bench: Bench, task: Task) -> tuple[str, ...]:
    return inputs_of(task, next(iter(cases_of(bench.sources, task.campaign, bench.seeds[0]).values())).recording)


def _budget(bench: Bench) -> dict[str, float | int | str]:
    cases = cases_of(bench.sources, "campaign", bench.seeds[0])
    return {
        "trials": bench.trials,
        "effort": bench.effort,
        "seeds": len(bench.seeds),
        "recordings": len(cases),
        "seconds_a_recording": max(len(case.recording) * case.recording.sample_time_s for case in cases.values()),
        "source": "simulated campaigns" if bench.sources.simulated else "own recordings",
    }
