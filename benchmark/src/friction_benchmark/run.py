"""One benchmark from configuration to page: results, report and MLflow runs, below the folder ``benchmark/``."""

import time
from dataclasses import asdict, replace
from pathlib import Path

from cylinder_friction.execution.measuring import measured
from cylinder_friction.files.whole_files import hash_of, read_json, write_json
from cylinder_friction.import_graph import relative_to_source, used_files
from cylinder_friction.run_record import Dataset, RunRecord, Scalar
from cylinder_friction.stages._stage import artifacts, datasets, flat
from cylinder_friction.tracking.log_run import log_run, track_or_warn
from cylinder_friction.tracking.repository import TrackingError, commit_of, repository_root
from friction_benchmark.cache import Cache
from friction_benchmark.campaigns import INGEST
from friction_benchmark.conclusions import findings_of
from friction_benchmark.datasets import Sources, key_of
from friction_benchmark.jobs import PACKAGES, code_key
from friction_benchmark.params import RIG, BenchmarkParams
from friction_benchmark.plan import Plan
from friction_benchmark.registry import MODULES
from friction_benchmark.report.write import write_report
from friction_benchmark.results import BenchmarkResults, Entry, TaskResult
from friction_benchmark.runner import Runner

EXPERIMENT = "benchmark"  # The hundreds of runs have an MLflow experiment of their own, ``cylinder-friction-benchmark``
OWN_ROLES = ("train", "validation", "test")
RESULTS_FILE = Path("reports/benchmark.json")
REPORT_FILE = Path("reports/benchmark.html")
RECORD_FILE = Path("reports/runs/benchmark.json")
INPUTS_FILE = Path("inputs.json")
CACHE = Path(".cylinder-friction/benchmark-cache")


def run(params: BenchmarkParams, *, prune: bool = False) -> str:
    """Write results, report and the record of the run, and log it; return in words what was computed.

    A killed benchmark goes on where it was. ``prune`` removes from the cache what this run did not use.
    """
    root, started_s = Path.cwd(), time.time()
    runner = runner_from(params)
    with measured() as took:
        record = evaluate(params, runner)
    record = replace(record, took=took(), commit=commit_of(repository_root(root)))
    write_json(RECORD_FILE, record.to_dict())
    track_or_warn(record, root)
    counts = ", ".join(f"{count} {kind}" for kind, count in runner.computed.items())
    words = f"computed: {counts}; everything else was in {runner.cache}"
    if prune:  # file systems keep time in steps of some milliseconds
        words += f"\npruned: {Cache(runner.cache).prune(started_s - 1.0)} entries"
    return words


def evaluate(params: BenchmarkParams, runner: Runner) -> RunRecord:
    """Write ``reports/benchmark.json`` and ``reports/benchmark.html``; return what MLflow is to show."""
    results = runner.run()
    findings = findings_of(results)
    write_json(RESULTS_FILE, {**asdict(results), "findings": findings})
    write_report(results, findings, REPORT_FILE)
    return run_record(params, results, findings, datasets(dict(runner.sources.own)))


def write_inputs(params: BenchmarkParams) -> None:
    """Write the hash of every module that the benchmark imports, and of your own recordings, if they are used."""
    files = used_files(__name__, *MODULES, packages=PACKAGES)
    code = {relative_to_source(file, PACKAGES).as_posix(): hash_of(file) for file in files}
    write_json(INPUTS_FILE, {"code": code, "recordings": _recordings(params)})


def track() -> str:
    """Log the finished benchmark to MLflow, unless it is there; return the run's id."""
    if not RECORD_FILE.is_file():
        raise TrackingError(f"{RECORD_FILE.resolve()}: not there; run `make benchmark` or `dvc pull` in benchmark/")
    return log_run(RunRecord.from_dict(read_json(RECORD_FILE)), Path.cwd())


def summary() -> str:
    """Return what was found, one paragraph per task, and where the page is."""
    findings = read_json(RESULTS_FILE)["findings"]
    return "\n\n".join([*(f"{task}: {words}" for task, words in findings.items()), f"page     {REPORT_FILE.resolve()}"])


def runner_from(params: BenchmarkParams) -> Runner:
    """Return what runs the configured benchmark."""
    cache = repository_root(Path.cwd()) / CACHE
    recordings = _recordings(params)
    sources = Sources(
        folder=cache / "campaigns",
        sizes=params.campaign,
        cylinder=params.cylinder,
        code=key_of([code_key("friction_benchmark.campaigns"), hash_of(INGEST)]),
        own=tuple((role, Path(params.source) / role) for role in recordings),
        own_hashes=tuple(recordings.items()),
    )
    return Runner(
        plan=Plan(**params.plan.model_dump(), **params.budget.model_dump()),
        sources=sources,
        cache=cache,
        settings=params.scoring,
        workers=params.workers,
    )


def _recordings(params: BenchmarkParams) -> dict[str, str]:
    """Return the hash of your own recordings by their role; nothing where campaigns are simulated."""
    return {} if params.source == RIG else {role: hash_of(Path(params.source) / role) for role in OWN_ROLES}


def run_record(
    params: BenchmarkParams, results: BenchmarkResults, findings: dict[str, str], used: dict[str, Dataset]
) -> RunRecord:
    """Return the benchmark's run, and below it one run per task, split and model, to be compared with each other."""
    budget = params.budget
    shared: dict[str, Scalar] = {**budget.model_dump(), "seeds": len(params.plan.seeds)}
    children = [_run_of(found, entry, shared, results) for found in results.tasks for entry in found.entries]
    best = {f"{found.task}.{found.split}": found.entries[0].score for found in results.tasks if found.entries}
    return RunRecord(
        name="benchmark",
        params=flat(params),
        metrics={f"{where}.best_percent": score.percent.value for where, score in best.items()},
        tags={f"finding.{task}": words for task, words in findings.items()},
        artifacts=artifacts(RESULTS_FILE, REPORT_FILE),
        datasets=used,
        children=tuple(children),
        experiment=EXPERIMENT,
    )


def _run_of(found: TaskResult, entry: Entry, shared: dict[str, Scalar], results: BenchmarkResults) -> RunRecord:
    who = results.models[entry.model]
    return RunRecord(
        name=f"{found.task} {found.split} {entry.model}",
        params={"task": found.task, "split": found.split, "model": entry.model, **shared}
        | {f"tuned.{name}": value for name, value in entry.tuning.items() if name != "validation_percent"},
        metrics=_metrics(entry),
        tags={"family": who.family, "source": who.source, "reference": found.reference, "baseline": found.baseline},
    )


def _metrics(entry: Entry) -> dict[str, float]:
    score, trust, ahead = entry.score, entry.trust, entry.below_baseline
    metrics = {"percent": score.percent.value, "percent_low": score.percent.low, "percent_high": score.percent.high}
    metrics |= {name: getattr(score, name) for name in ("mae_n", "rmse_n", "p95_n", "bias_n")}
    metrics |= {"lag_ms": 1e3 * score.lag_s, "multiply_adds": float(entry.multiply_adds)}
    metrics |= {"step_us": entry.step_us, "training_s": entry.training_s, **entry.extras}
    metrics |= {f"condition_{test}.percent": value for test, value in entry.by_condition.items()}
    metrics |= {f"seed_{seed}.percent": value for seed, value in entry.seeds.items()}
    metrics |= {f"{stratum}.mae_n": mae_n for stratum, (_, mae_n) in entry.strata.items()}
    if "validation_percent" in entry.tuning:
        metrics["validation_percent"] = float(entry.tuning["validation_percent"])
    if ahead is not None:
        metrics |= {"below_baseline": ahead.value, "below_baseline_low": ahead.low, "below_baseline_high": ahead.high}
    metrics |= {f"coverage.condition_{test}" if test else "coverage": v for test, v in trust.coverage.items()}
    metrics |= {"coverage.after_reversal": trust.coverage_after_reversal, "bounds_width_n": trust.width_n}
    of_truth = {} if trust.coverage_of_truth is None else {"coverage.of_truth": trust.coverage_of_truth}
    return {**metrics, **of_truth, "flagged": trust.flagged}
