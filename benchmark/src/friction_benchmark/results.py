"""What the benchmark found: plain numbers, written to ``reports/benchmark.json`` and drawn by the report."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

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
    """How far estimates are from the reference, over the usable rows of a set of recordings."""

    percent: Interval  # MAE / mean |friction| [%], with its block-bootstrap interval
    mae_n: float  # Of the absolute error [N]
    rmse_n: float  # Of the absolute error [N]
    p95_n: float  # Of the absolute error [N]
    bias_n: float  # Mean of estimate - reference [N]
    lag_s: float  # Shift at which estimate and reference are most alike; positive when the estimate is late [s]


@dataclass(frozen=True)
class Trust:
    """How far bounds and flags can be relied on."""

    # Share of usable rows whose label lies in the 90 % bounds, by the recordings' condition; ``""`` for all of them
    coverage: Mapping[str, float]
    coverage_after_reversal: float  # The same, just after reversals alone
    width_n: float  # Mean width of the bounds [N]
    flagged: float  # Share of rows that the model flags as outside its training range, by samples until then
    # Share of usable rows whose true friction lies in the bounds; None where it is not known
    coverage_of_truth: float | None = None


@dataclass(frozen=True)
class Entry:
    """One model on one task and split."""

    model: str  # Name in the registry
    score: Score  # Over all seeds' test recordings together
    seeds: Mapping[str, float]  # Percent of each seed
    by_condition: Mapping[str, float]  # Percent, by the recordings' condition
    strata: Mapping[str, tuple[float, float]]  # Percent and MAE [N] by stratum (``evaluation.strata.STRATA``)
    # Baseline's percent minus this model's, paired bootstrap; positive where the model is better. None where the
    # baseline failed.
    below_baseline: Interval | None
    trust: Trust
    multiply_adds: int  # In one step
    step_us: float  # Processor time of one sample while whole recordings are estimated [µs]
    training_s: float  # Processor time, median over seeds, each with all its folds [s]
    # What was chosen, and the validation percent that it reached; empty where there is nothing to tune
    tuning: Mapping[str, float | int | str] = field(default_factory=dict)
    extras: Mapping[str, float] = field(default_factory=dict)  # Other figures of the task, for example ``load_mae_n``


@dataclass(frozen=True)
class TaskResult:
    """One task on one split: a leaderboard."""

    task: str  # Name, for example ``forecast_100ms``
    split: str  # ``held_out_sessions``, ``leave_one_load_out``, ``leave_one_temperature_out`` or ``unseen_rig``
    title: str  # In words
    inputs: tuple[str, ...]  # Columns that models see
    reference: Reference  # What errors are against
    baseline: str  # Name of the model to beat
    mean_friction_n: float  # The denominator of percentages: mean |reference| of the test recordings [N]
    entries: tuple[Entry, ...]  # Best first
    # Models without an entry, and why: they need other inputs, or failed
    missing: Mapping[str, str] = field(default_factory=dict)
    explanation: str = ""  # What is asked and why, in one sentence
    # How far the off-line label itself is from true friction, MAE / mean |truth| [%]; None where truth is not known
    label_truth_percent: Interval | None = None

    def entry_of(self, model: str) -> Entry | None:
        """Return a model's entry; None where it has none."""
        return next((entry for entry in self.entries if entry.model == model), None)


@dataclass(frozen=True)
class ModelInfo:
    """What the report states about a model; see ``registry.RegisteredModel``."""

    title: str
    family: str
    source: str
    chosen: str


@dataclass(frozen=True)
class BenchmarkResults:
    """The whole benchmark."""

    tasks: tuple[TaskResult, ...]  # One leaderboard for each task and split
    models: Mapping[str, ModelInfo]  # By name
    budget: Mapping[str, float | int | str]  # In words and numbers: trials, effort, seeds, recordings
    # Tasks, or splits of a task, that the recordings do not allow, and why
    missing: Mapping[str, str] = field(default_factory=dict)
