"""What the benchmark found: plain numbers, written to ``reports/benchmark.json`` and drawn by the report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Self

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

Reference = Literal["label", "truth"]
NEEDS_MORE = "it needs more than"
"""So begins why a model has no entry where it did not fail: the task shows too few columns."""


@dataclass(frozen=True)
class Interval:
    """A figure and its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Score:
    """How far estimates are from the reference, over the usable rows of a set of recordings.

    Attributes:
        percent: MAE / mean |friction| [%], with its block-bootstrap interval.
        mae_n, rmse_n, p95_n: Of the absolute error [N].
        bias_n: Mean of estimate - reference [N].
        lag_s: Shift at which estimate and reference are most alike; positive when the estimate is late [s].
    """

    percent: Interval
    mae_n: float
    rmse_n: float
    p95_n: float
    bias_n: float
    lag_s: float


@dataclass(frozen=True)
class Trust:
    """How far bounds and flags can be relied on.

    Attributes:
        coverage: Share of usable rows whose label lies in the 90 % bounds, which were calibrated on labels, by the
            recordings' condition; ``""`` for all of them.
        coverage_after_reversal: The same, just after reversals alone.
        width_n: Mean width of the bounds [N].
        flagged: Share of rows that the model flags as outside its training range, by samples until then.
        outside: Share of rows whose inputs or velocity, filtered off line, lie outside the training range.
        caught: Share of the rows outside that are flagged; None where no row is outside.
        coverage_of_truth: Share of usable rows whose true friction lies in the bounds; None where it is not known.
    """

    coverage: Mapping[str, float]
    coverage_after_reversal: float
    width_n: float
    flagged: float
    outside: float
    caught: float | None = None
    coverage_of_truth: float | None = None


@dataclass(frozen=True)
class Residuals:
    """The residuals: moments, autocorrelation at lags, and correlation with what was measured."""

    skewness: float
    excess_kurtosis: float
    autocorrelation: Mapping[str, float]
    correlation_with: Mapping[str, float]


@dataclass(frozen=True)
class Entry:
    """One model on one task and split.

    Attributes:
        model: Name in the registry.
        score: Over all seeds' test recordings together.
        seeds: Percent of each seed.
        by_condition: Percent, by the recordings' condition.
        strata: Percent and MAE [N] by stratum (``evaluation.strata.STRATA``).
        below_baseline: Baseline's percent minus this model's, paired bootstrap; positive where the model is better.
            None where the baseline failed.
        trust: None where there are no bounds.
        residuals: None where they were not examined.
        multiply_adds: In one step.
        step_us: Processor time of one sample while whole recordings are estimated [µs].
        training_s: Processor time, median over seeds, each with all its folds [s].
        tuning: What was chosen, and the validation percent that it reached; empty where there is nothing to tune.
        extras: Other figures of the task, for example ``load_mae_n``.
    """

    model: str
    score: Score
    seeds: Mapping[str, float]
    by_condition: Mapping[str, float]
    strata: Mapping[str, tuple[float, float]]
    below_baseline: Interval | None
    trust: Trust | None
    residuals: Residuals | None
    multiply_adds: int
    step_us: float
    training_s: float
    tuning: Mapping[str, float | int | str] = field(default_factory=dict)
    extras: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return what ``dataclasses.asdict`` and JSON made a dictionary of."""

        def of(kind: Callable[..., Any], name: str) -> Any:
            return None if content[name] is None else kind(**content[name])

        score = Score(**{**content["score"], "percent": Interval(**content["score"]["percent"])})
        strata = {name: (percent, mae_n) for name, (percent, mae_n) in content["strata"].items()}
        parts = {"below_baseline": Interval, "trust": Trust, "residuals": Residuals}
        return cls(**{**content, "score": score, "strata": strata, **{name: of(parts[name], name) for name in parts}})


@dataclass(frozen=True)
class TaskResult:
    """One task on one split: a leaderboard.

    Attributes:
        task: Name, for example ``forecast_100ms``.
        split: ``held_out_sessions``, ``leave_one_load_out``, ``leave_one_temperature_out`` or ``unseen_rig``.
        title: In words.
        inputs: Columns that models see.
        reference: What errors are against.
        baseline: Name of the model to beat.
        mean_friction_n: The denominator of percentages: mean |reference| of the test recordings [N].
        entries: Best first.
        missing: Models without an entry, and why: they need other inputs, or failed.
        explanation: What is asked and why, in one sentence.
        label_truth_percent: How far the off-line label itself is from true friction, MAE / mean |truth| [%]; None where
            truth is not known.
    """

    task: str
    split: str
    title: str
    inputs: tuple[str, ...]
    reference: Reference
    baseline: str
    mean_friction_n: float
    entries: tuple[Entry, ...]
    missing: Mapping[str, str] = field(default_factory=dict)
    explanation: str = ""
    label_truth_percent: Interval | None = None


@dataclass(frozen=True)
class ModelInfo:
    """What the report states about a model; see ``registry.RegisteredModel``."""

    title: str
    family: str
    source: str
    chosen: str


@dataclass(frozen=True)
class BenchmarkResults:
    """The whole benchmark.

    Attributes:
        tasks: One leaderboard for each task and split.
        models: By name.
        budget: In words and numbers: trials, effort, seeds, recordings.
        missing: Tasks, or splits of a task, that the recordings do not allow, and why.
    """

    tasks: tuple[TaskResult, ...]
    models: Mapping[str, ModelInfo]
    budget: Mapping[str, float | int | str]
    missing: Mapping[str, str] = field(default_factory=dict)
