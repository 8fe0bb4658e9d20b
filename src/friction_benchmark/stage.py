"""Stage ``benchmark``: every model of the literature on every task, as leaderboards, one report and runs to compare."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.evaluation.strata import StrataLimits
from cylinder_friction.recordings.files import write_json
from cylinder_friction.stages._stage import (
    PROCESSED_FOLDERS,
    REPORTS_FOLDER,
    artifacts,
    cylinder_from,
    flat,
    hash_of,
)
from cylinder_friction.tracking.run_record import BENCHMARK, RunRecord
from friction_benchmark.conclusions import findings_of
from friction_benchmark.conducting import run_benchmark
from friction_benchmark.data import Sizes, Sources
from friction_benchmark.programme import Programme
from friction_benchmark.report.write import write_report
from friction_benchmark.running import Bench
from friction_benchmark.scoring import ScoreSettings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.params.checking import Params
    from cylinder_friction.tracking.run_record import Scalar
    from friction_benchmark.results import BenchmarkResults, Entry, TaskResult

RESULTS_FILE = REPORTS_FOLDER / "benchmark.json"
REPORT_FILE = REPORTS_FOLDER / "benchmark.html"
OWN_SOURCE = "data/processed"
CACHE = Path(".cylinder-friction/resume")
CODE = Path(__file__).parents[1]
CODE_OF_DATA = ("rig", "recordings", "signals", "labelling", "evaluation/benchmark/campaigns.py")
CODE_OF_ANSWERS = (*CODE_OF_DATA, "friction_models", "estimators", "evaluation/splits.py")


def run(params: Params) -> RunRecord:
    """Write ``reports/benchmark.json`` and ``reports/benchmark.html``; a killed benchmark goes on where it was.

    Raises:
        FileNotFoundError: One's own recordings are to be used, but ``data/processed`` is not there.
        ValueError: A model is not in the roster.
        RecordingError: There are too few sessions to split.
    """
    bench, folders = bench_from(params)
    results = run_benchmark(bench, programme_from(params), score_settings(params), params.benchmark.workers)
    findings = findings_of(results)
    write_json(RESULTS_FILE, {**asdict(results), "findings": findings})
    write_report(results, findings, REPORT_FILE)
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    return run_record(params, results, findings)


def bench_from(params: Params) -> tuple[Bench, tuple[Path, ...]]:
    """Return what the workers are told, and the folders that hold finished work until the whole is finished."""
    settings = params.benchmark
    sizes = Sizes(**settings.campaign.model_dump())
    cylinder = cylinder_from(params.cylinder)
    own = tuple((role, folder) for role, folder in PROCESSED_FOLDERS.items()) if settings.source == OWN_SOURCE else ()
    recorded = [hash_of(folder) for _, folder in own]
    data = _folder("benchmark-data", [asdict(sizes), asdict(cylinder)], CODE_OF_DATA)
    told = [settings.model_dump(), asdict(cylinder), recorded]
    # What draws the report may change without a new answer.
    benchmark = tuple(
        path.relative_to(CODE).as_posix()
        for path in sorted((CODE / "evaluation/benchmark").rglob("*.py"))
        if "report" not in path.parts and path.stem not in ("findings", "results")
    )
    work = _folder("benchmark", told, (*CODE_OF_ANSWERS, *benchmark))
    bench = Bench(
        cylinder=cylinder,
        sources=Sources(data, sizes, own),
        store=work,
        seeds=tuple(settings.seeds),
        effort=settings.effort,
        trials=settings.trials,
    )
    return bench, (data, work)


def programme_from(params: Params) -> Programme:
    settings = params.benchmark
    return Programme(
        tasks=tuple(settings.tasks),
        splits={split: tuple(tasks) for split, tasks in settings.splits.items()},
        models=tuple(settings.models),
    )


def score_settings(params: Params) -> ScoreSettings:
    settings = params.compare
    return ScoreSettings(
        limits=StrataLimits(
            settings.standstill_velocity_m_s, settings.stribeck_velocity_m_s, settings.reversal_window_s
        ),
        maximum_lag_s=params.benchmark.maximum_lag_s,
        bootstrap_repeats=settings.bootstrap_repeats,
        bootstrap_block_s=settings.bootstrap_block_s,
    )


def run_record(params: Params, results: BenchmarkResults, findings: dict[str, str]) -> RunRecord:
    """Return the stage's run, and below it one run a task, split and model, to be compared with each other."""
    settings = params.benchmark
    told: dict[str, Scalar] = {"effort": settings.effort, "trials": settings.trials, "seeds": len(settings.seeds)}
    children = [_run_of(found, entry, told, results) for found in results.tasks for entry in found.entries]
    best = {
        f"{found.task}.{found.split}.best_percent": found.entries[0].score.percent.value
        for found in results.tasks
        if found.entries
    }
    own = settings.source == OWN_SOURCE
    return RunRecord(
        name="benchmark",
        params=flat(settings),
        metrics=best,
        tags={f"finding.{task}": words for task, words in findings.items()},
        artifacts=artifacts(RESULTS_FILE, REPORT_FILE),
        datasets={role: hash_of(folder) for role, folder in PROCESSED_FOLDERS.items()} if own else {},
        children=tuple(children),
        experiment=BENCHMARK,
    )


def _run_of(found: TaskResult, entry: Entry, told: dict[str, Scalar], results: BenchmarkResults) -> RunRecord:
    who = results.participants[entry.model]
    return RunRecord(
        name=f"{found.task} {found.split} {entry.model}",
        params={"task": found.task, "split": found.split, "model": entry.model, **told}
        | {f"tuned.{name}": value for name, value in entry.tuning.items() if name != "validation_percent"},
        metrics=_metrics(entry),
        tags={"family": who.family, "source": who.source, "reference": found.reference, "floor": found.floor},
    )


def _metrics(entry: Entry) -> dict[str, float]:
    score = entry.score
    metrics: dict[str, float] = {
        "percent": score.percent.value,
        "percent_low": score.percent.low,
        "percent_high": score.percent.high,
        "mae_n": score.mae_n,
        "rmse_n": score.rmse_n,
        "p95_n": score.p95_n,
        "bias_n": score.bias_n,
        "lag_ms": 1e3 * score.lag_s,
        "multiply_adds": float(entry.multiply_adds),
        "step_us": entry.step_us,
        "training_s": entry.training_s,
    }
    metrics |= {f"condition_{test}.percent": value for test, value in entry.by_condition.items()}
    metrics |= {f"seed_{seed}.percent": value for seed, value in entry.seeds.items()}
    metrics |= {f"{stratum}.mae_n": mae_n for stratum, (_, mae_n) in entry.strata.items()}
    metrics |= dict(entry.extras)
    if "validation_percent" in entry.tuning:
        metrics["validation_percent"] = float(entry.tuning["validation_percent"])
    if entry.below_floor is not None:
        ahead = entry.below_floor
        metrics |= {"below_floor": ahead.value, "below_floor_low": ahead.low, "below_floor_high": ahead.high}
    if entry.trust is not None:
        metrics |= {f"coverage.condition_{test}" if test else "coverage": v for test, v in entry.trust.coverage.items()}
        metrics |= {
            "coverage.after_reversal": entry.trust.coverage_after_reversal,
            "bounds_width_n": entry.trust.width_n,
            "flagged": entry.trust.flagged,
        }
        if entry.trust.coverage_of_truth is not None:
            metrics["coverage.of_truth"] = entry.trust.coverage_of_truth
    return metrics


def _folder(name: str, told: Sequence[Any], code: Sequence[str]) -> Path:
    """Return where finished work lies, by a hash of all it depends on, the code included."""
    hashes = [hash_of(CODE / path) for path in code]
    key = hashlib.sha256(json.dumps([told, hashes], sort_keys=True).encode()).hexdigest()[:16]
    return CACHE / f"{name}-{key}"
