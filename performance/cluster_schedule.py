"""The benchmark's full recipe on 2 to 1,000 workers, simulated from measured sizes of its pieces.

    python performance/cluster_schedule.py [--effort 0.05]

Measured here, as seconds of CPU: simulating a campaign, and for every model a fit of the identity task on few
recordings of the full recipe's length (after a first one, in which numba compiles), one on four times as many, one
with twice the effort, and its estimates; and what the scheduler of a Dask cluster on loopback spends on a piece.
Assumed: a fit is a constant and, in proportion to effort, a constant and a part that grows with rows; estimates are
in proportion to rows; every model takes every task as long as it takes ``identity``; a trial takes as long as one
with the defaults; workers are as fast as this core; files cost nothing. Pieces are given out in the benchmark's
order, one phase after the other: campaigns, each round of trials, predictions. Scores are left out.
"""

from __future__ import annotations

import argparse
import heapq
import os
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass, replace
from functools import partial
from operator import methodcaller
from pathlib import Path

from loopback_cluster import SOURCE, loopback_cluster

from cylinder_friction.execution.cluster import Cluster
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.campaigns import simulate
from friction_benchmark.datasets import Sizes, Sources, cases_of, folds_of, inputs_of, twin_recordings
from friction_benchmark.folds import HELD_OUT, LEAVE_LOAD, LEAVE_TEMPERATURE, UNSEEN_RIG
from friction_benchmark.jobs import PredictionJob
from friction_benchmark.params import BenchmarkParams, compose_benchmark
from friction_benchmark.registry.model import BuildConfiguration, RegisteredModel
from friction_benchmark.run import runner_from
from friction_benchmark.tasks import task_named

WORKERS = (1, 2, 10, 100, 1000)
TASK = task_named("identity")
RATE_HZ = 200.0
MORE = 4  # times as many recordings show how a fit grows with rows
PIECES = 2000  # to measure the scheduler with
FOLDS = {UNSEEN_RIG: 1, LEAVE_LOAD: 4, LEAVE_TEMPERATURE: 3}


@dataclass(frozen=True)
class Cost:
    """Of one model [s of CPU]: a fit without effort; what full effort adds, and per row; an estimate per row."""

    least_s: float
    effort_s: float
    row_s: float
    estimate_s: float

    def fit_s(self, rows: float, effort: float) -> float:
        return self.least_s + effort * (self.effort_s + self.row_s * rows)


def main() -> int:
    """Print sizes, assumptions and the schedule."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effort", type=float, default=0.05, help="of the measured fits")
    options = parser.parse_args()
    os.chdir(SOURCE.parent / "benchmark")
    smoke, full = compose_benchmark(["experiment=smoke"]), compose_benchmark(["experiment=full"])
    with tempfile.TemporaryDirectory() as name:
        few = replace(runner_from(smoke).sources, folder=Path(name))
        sizes = replace(few.sizes, duration_s=full.campaign.duration_s)
        more = replace(sizes, recordings_per_session=MORE, twin_rigs=MORE * sizes.twin_rigs)
        sources = [replace(few, sizes=each) for each in (sizes, more)]
        simulated_s = [campaign_cost(each) for each in sources][-1]
        costs = {
            model.name: model_cost(model, sources, options.effort)
            for model in runner_from(full).plan.chosen_models().values()
            if model.supports(TASK.inputs)
        }
        piece_s = scheduler_cost(Path(name))
    print(
        f"\nscheduler: {1e3 * piece_s:.2f} ms a piece; campaigns: {1e3 * simulated_s:.2f} ms for a second of recording"
    )
    for batch in (1, full.budget.batch):
        phases = pieces(full, costs, simulated_s, batch)
        count, total_s = sum(map(len, phases)), sum(map(sum, phases))
        hours = ", ".join(f"{schedule(phases, n, piece_s) / 3600.0:.3g} h on {n}" for n in WORKERS)
        print(
            f"trials in batches of {batch}: {count} pieces, the longest {max(map(max, phases)) / 60.0:.2g} min, "
            f"{total_s / 3600.0:.3g} worker-hours"
        )
        print(f"  {hours}")
    return 0


def campaign_cost(sources: Sources) -> float:
    """Return what a second of a simulated recording costs [s]."""
    simulate(sources, "twin", 0)  # compiles
    began_s = time.process_time()
    simulate(sources, "campaign", 0)
    return (time.process_time() - began_s) / recorded_s(sources.sizes)


def recorded_s(sizes: Sizes) -> float:
    return 4 * sizes.sessions_per_condition * sizes.recordings_per_session * sizes.duration_s


def model_cost(model: RegisteredModel, sources: list[Sources], effort: float) -> Cost:
    """Return what a model costs, from fits on few and on more rows; nothing if it cannot be fitted to so little."""
    rows: list[int] = []
    spent_s: list[float] = []
    try:
        # the first compiles
        for each, share in (
            (sources[0], effort),
            (sources[0], effort),
            (sources[1], effort),
            (sources[0], 2.0 * effort),
        ):
            recordings = training_recordings(model, each)
            inputs = inputs_of(each, TASK, 0)
            estimator = model.build(BuildConfiguration(each.cylinder, inputs, 0, share, dict(model.defaults)))
            began_s = time.process_time()
            estimator.fit(recordings)
            spent_s.append(time.process_time() - began_s)
            rows.append(sum(map(len, recordings)))
        estimator.estimate(recordings[0])
        began_s = time.process_time()
        estimator.estimate(recordings[0])
        estimate_s = (time.process_time() - began_s) / len(recordings[0])
    except ValueError:
        traceback.print_exc()
        return Cost(0.0, 0.0, 0.0, 0.0)
    row_s = max(0.0, (spent_s[2] - spent_s[1]) / (rows[2] - rows[1])) / effort
    effort_s = max(0.0, (spent_s[3] - spent_s[1]) / effort - row_s * rows[1])
    least_s = max(0.0, spent_s[1] - effort * (effort_s + row_s * rows[1]))
    print(
        f"{model.name:24} fit {spent_s[1]:6.2f} s on {rows[1]} rows, {spent_s[2]:6.2f} s on {rows[2]}, "
        f"{spent_s[3]:6.2f} s with twice the effort; estimate "
        f"{1e6 * estimate_s:6.2f} µs a row",
        flush=True,
    )
    return Cost(least_s, effort_s, row_s, estimate_s)


def training_recordings(model: RegisteredModel, sources: Sources) -> list[Recording]:
    if model.trained_on == "twin":
        return list(twin_recordings(sources, TASK, 0))
    cases = cases_of(sources, TASK, TASK.campaign, 0)
    return [cases[name].recording for name in folds_of(sources, TASK, HELD_OUT, 0)[0].train]


def scheduler_cost(folder: Path) -> float:
    """Return what the scheduler takes for a piece that does nothing, one of many [s]."""
    with loopback_cluster(folder) as started, Cluster(started.address) as cluster:
        nothing = methodcaller("strip")
        list(cluster.in_order([partial(nothing, "")] * 10))
        began_s = time.monotonic()
        list(cluster.in_order([partial(nothing, "")] * PIECES))
        return (time.monotonic() - began_s) / PIECES


def pieces(params: BenchmarkParams, costs: dict[str, Cost], simulated_s: float, batch: int) -> list[list[float]]:
    """Return the sizes of the pieces, phase by phase [s]."""
    sizes, plan, budget = Sizes(**params.campaign.model_dump()), params.plan, params.budget
    seeds, tasks = len(plan.seeds), [task_named(name) for name in plan.tasks]
    models, splits = runner_from(params).plan.chosen_models(), runner_from(params).plan.splits
    session_rows = 4 * sizes.recordings_per_session * sizes.duration_s * RATE_HZ
    twin_rows = 4 * 2 * sizes.twin_rigs * sizes.duration_s * RATE_HZ
    train_rows = session_rows * (sizes.sessions_per_condition - sizes.test_sessions - sizes.validation_sessions)
    kinds = [
        recorded_s(sizes),
        recorded_s(sizes) * sizes.unseen_sessions / sizes.sessions_per_condition,
        twin_rows / RATE_HZ,
    ]
    campaigns = [simulated_s * each for each in kinds for _ in range(2 * seeds)]  # with and without a load
    tuned = {task.tuned_as or task.name for task in tasks}
    rounds: list[list[float]] = [[] for _ in range(-(-budget.trials // batch))]
    fits: dict[tuple[str, ...], float] = {}
    for name, cost in reversed(costs.items()):
        model = models[name]
        fit_s = cost.fit_s(twin_rows if model.trained_on == "twin" else train_rows, budget.effort)
        trial_s = fit_s + cost.estimate_s * session_rows * sizes.validation_sessions
        evaluated_s = cost.estimate_s * session_rows * (sizes.validation_sessions + sizes.test_sessions)
        for task in [task for task in tasks if model.supports(task.inputs)]:
            for number, each in enumerate(rounds if model.space and task.name in tuned else ()):
                each += [trial_s] * min(batch, budget.trials - number * batch)
            for split, folds in {HELD_OUT: 1, **FOLDS}.items():
                for fold in range(folds if split == HELD_OUT or task.name in splits[split] else 0):
                    for seed in plan.seeds:
                        shared = PredictionJob(model, task, split, fold, seed, {}, False, "").shared_fit()
                        fits[shared] = fits.get(shared, fit_s) + evaluated_s
    return [campaigns, *rounds, list(fits.values())]


def schedule(phases: list[list[float]], workers: int, piece_s: float) -> float:
    """Return when the last piece of the last phase ends [s]; the scheduler gives out one piece after the other."""
    now_s = 0.0
    for phase in phases:
        free_s = [now_s] * workers
        given_s = end_s = now_s
        for size_s in phase:
            given_s = max(given_s + piece_s, heapq.heappop(free_s))
            heapq.heappush(free_s, given_s + size_s)
            end_s = max(end_s, given_s + size_s)
        now_s = end_s
    return now_s


if __name__ == "__main__":
    sys.exit(main())
