"""The benchmark's full recipe on 2 to 1,000 workers, simulated from measured sizes of its pieces.

    python performance/cluster_schedule.py [--effort 0.05] [--batch 4]

Measured here, as seconds of CPU: simulating a campaign, and for every model a fit of the smoke recipe's identity task
(after a first one, in which numba compiles), one on recordings four times as long, and its estimates; and what the
scheduler of a Dask cluster on loopback spends on a piece. Assumed: fits grow with rows as between the two, and in
proportion to effort, estimates in proportion to rows; every model takes every task as long as it takes ``identity``;
workers are as fast as this core; files cost nothing. Pieces are given out in the benchmark's order, one phase after the
other: campaigns, tunings, predictions. Scores are left out. The last lines are what batches of trials would give, were
a tuning split into them.
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
from friction_benchmark.params import BenchmarkParams, compose_benchmark
from friction_benchmark.registry.model import BuildConfiguration, RegisteredModel
from friction_benchmark.run import runner_from
from friction_benchmark.tasks import task_named

WORKERS = (1, 2, 10, 100, 1000)
TASK = task_named("identity")
RATE_HZ = 200.0
LONGER = 4  # are the recordings that show how a fit grows with rows
PIECES = 2000  # to measure the scheduler with
FOLDS = {UNSEEN_RIG: 1, LEAVE_LOAD: 4, LEAVE_TEMPERATURE: 3}


@dataclass(frozen=True)
class Cost:
    """Of one model [s of CPU]: a fit of full effort on no rows and per row, and an estimate per row."""

    least_s: float
    row_s: float
    estimate_s: float

    def fit_s(self, rows: float) -> float:
        return self.least_s + self.row_s * rows


def main() -> int:
    """Print sizes, assumptions and the schedule."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effort", type=float, default=0.05, help="of the measured fits")
    parser.add_argument("--batch", type=int, default=4, help="trials of a tuning at a time")
    options = parser.parse_args()
    os.chdir(SOURCE.parent / "benchmark")
    smoke, full = compose_benchmark(["experiment=smoke"]), compose_benchmark(["experiment=full"])
    with tempfile.TemporaryDirectory() as name:
        few = replace(runner_from(smoke).sources, folder=Path(name))
        sources = [few, replace(few, sizes=replace(few.sizes, duration_s=LONGER * few.sizes.duration_s))]
        simulated_s = [campaign_cost(each) for each in sources][-1]
        costs = {
            model.name: model_cost(model, sources, options.effort)
            for model in runner_from(full).plan.chosen_models().values()
            if model.supports(inputs_of(few, TASK, 0))
        }
        piece_s = scheduler_cost(Path(name))
    print(
        f"\nscheduler: {1e3 * piece_s:.2f} ms a piece; campaigns: {1e3 * simulated_s:.2f} ms for a second of recording"
    )
    for batch, words in ((0, "as it is"), (options.batch, f"tunings in batches of {options.batch} trials")):
        phases = pieces(full, costs, simulated_s, batch)
        count, total_s = sum(map(len, phases)), sum(map(sum, phases))
        hours = ", ".join(f"{schedule(phases, n, piece_s) / 3600.0:.3g} h on {n}" for n in WORKERS)
        print(
            f"{words}: {count} pieces, the longest {max(map(max, phases)) / 3600.0:.2g} h, "
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
        for each in (sources[0], *sources):  # the first compiles
            recordings = training_recordings(model, each)
            inputs = inputs_of(each, TASK, 0)
            estimator = model.build(BuildConfiguration(each.cylinder, inputs, 0, effort, dict(model.defaults)))
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
        return Cost(0.0, 0.0, 0.0)
    row_s = max(0.0, (spent_s[2] - spent_s[1]) / (rows[2] - rows[1]))
    print(
        f"{model.name:24} fit {spent_s[1]:6.2f} s on {rows[1]} rows, {spent_s[2]:6.2f} s on {rows[2]}; estimate "
        f"{1e6 * estimate_s:6.2f} µs a row",
        flush=True,
    )
    return Cost(max(0.0, spent_s[1] - row_s * rows[1]) / effort, row_s / effort, estimate_s)


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
    """Return the sizes of the pieces, phase by phase [s]; ``batch`` 0: a tuning is one piece."""
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
    tunings: list[float] = []
    rounds: list[list[float]] = [[] for _ in range(-(-budget.trials // batch))] if batch else []
    groups: dict[tuple[str, str, str], float] = {}
    for name, cost in reversed(costs.items()):
        model = models[name]
        fit_s = budget.effort * cost.fit_s(twin_rows if model.trained_on == "twin" else train_rows)
        trial_s = fit_s + cost.estimate_s * session_rows * sizes.validation_sessions
        evaluated_s = cost.estimate_s * session_rows * (sizes.validation_sessions + sizes.test_sessions)
        for task in tasks:
            if model.space and not task.tuned_as:
                tunings.append(budget.trials * trial_s)
                for number, each in enumerate(rounds):
                    each += [trial_s] * min(batch, budget.trials - number * batch)
            for split, folds in {HELD_OUT: 1, **FOLDS}.items():
                if split == HELD_OUT or task.name in splits[split]:
                    left_out = split if split in (LEAVE_LOAD, LEAVE_TEMPERATURE) else ""
                    group = (name, task.campaign, left_out)  # as the benchmark puts jobs together
                    groups[group] = groups.get(group, 0.0) + folds * (fit_s + evaluated_s)
    predictions = [size_s for size_s in groups.values() for _ in range(seeds)]
    return [campaigns, *(rounds or [tunings]), predictions]


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
