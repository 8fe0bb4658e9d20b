"""The numbers behind the figures: one source for PNGs, the report's interactive plots and ``dvc plots``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.comparison import Comparison

HISTOGRAM_BINS = 81
AGREEMENT_POINTS = 1500
VELOCITY_BINS = 40
MINIMUM_ROWS_A_BIN = 20


@dataclass(frozen=True)
class LearningCurve:
    """Error after each epoch of a training [N], the content of ``learning_curve.json``."""

    epoch: Sequence[int]
    train_mae_n: Sequence[float]
    validation_mae_n: Sequence[float]
    best_epoch: int  # Epoch whose network was kept


@dataclass(frozen=True, eq=False)
class Excerpt:
    """A stretch of one recording; forces in newtons, NaN in unusable rows, shape ``(n,)``."""

    condition: str
    recording: str
    time_s: Array
    lines_n: dict[str, Array]

    def residuals_n(self) -> dict[str, Array]:
        """Compute label minus estimate [N] of every estimator shown."""

        estimates = {name: values for name, values in self.lines_n.items() if name not in ("label", "truth")}
        return {name: self.lines_n["label"] - values for name, values in estimates.items()}


def excerpt(comparison: Comparison, condition: str, shown: Sequence[str], duration_s: float) -> Excerpt:
    """Cut out the first stretch of a condition's recordings with the most usable rows in motion.

    Its lines are ``label``, ``truth`` if known, and the estimators in ``shown``.
    """
    best = (-1, 0, 0, 0)
    traces = comparison.of_condition(condition)
    for index, trace in enumerate(traces):
        rows = min(len(trace.time_s), max(2, round(duration_s / trace.sample_time_s)))
        moving = np.concatenate([[0], np.cumsum(trace.usable & (np.abs(trace.velocity_m_s) > 1e-3))])
        counts = moving[rows:] - moving[:-rows]
        start = int(np.argmax(counts))
        if int(counts[start]) > best[0]:
            best = (int(counts[start]), index, start, start + rows)
    _, index, start, stop = best
    trace = traces[index]
    known = {} if trace.truth_n is None else {"truth": trace.truth_n}
    lines = {"label": trace.label_n} | known | {name: trace.estimates_n[name] for name in shown}
    cut = slice(start, stop)
    shown_lines = {name: np.where(trace.usable, values, np.nan)[cut] for name, values in lines.items()}
    return Excerpt(condition, trace.name, trace.time_s[cut], shown_lines)


@dataclass(frozen=True, eq=False)
class Histogram:
    """Histogram of residuals, as densities [1/N]; ``outside`` is the share beyond its range."""

    centres_n: Array
    density: Array
    normal_density: Array
    quartiles_n: tuple[float, float, float]
    outside: float

    @property
    def width_n(self) -> float:
        return float(self.centres_n[1] - self.centres_n[0])


def histogram(values: Array) -> Histogram:
    """Compute the histogram of residuals [N], and the normal curve of the same mean and deviation."""
    mean, deviation = float(values.mean()), float(values.std())
    most, nearly_all = np.quantile(np.abs(values), (0.75, 0.995))
    reach = max(min(float(nearly_all), 5.0 * float(most)), 1e-9)
    edges = np.linspace(-reach, reach, HISTOGRAM_BINS + 1)
    counts, _ = np.histogram(values, bins=edges)
    centres = 0.5 * (edges[1:] + edges[:-1])
    scale = max(deviation, 1e-12)
    normal = np.exp(-0.5 * ((centres - mean) / scale) ** 2) / (scale * np.sqrt(2.0 * np.pi))
    lower, median, upper = (float(value) for value in np.quantile(values, (0.25, 0.5, 0.75)))
    density = counts / (len(values) * (edges[1] - edges[0]))
    return Histogram(centres, density, normal, (lower, median, upper), 1.0 - float(counts.sum()) / len(values))


@dataclass(frozen=True, eq=False)
class Agreement:
    """Estimated against calculated friction [N]: points of evenly chosen rows, and figures over all usable rows."""

    label_n: Array
    estimate_n: Array
    r_squared: float
    slope: float
    intercept_n: float


def agreement(comparison: Comparison, estimator: str, condition: str) -> Agreement:
    """Collect a condition's points, with slope and intercept of the least-squares line and R² of the line y = x."""
    traces = comparison.of_condition(condition)
    label = np.concatenate([trace.label_n[trace.usable] for trace in traces])
    estimate = np.concatenate([trace.estimates_n[estimator][trace.usable] for trace in traces])
    spread = float(np.mean((label - label.mean()) ** 2))
    slope = float(np.mean((label - label.mean()) * (estimate - estimate.mean()))) / spread if spread > 0.0 else 0.0
    r_squared = 1.0 - float(np.mean((label - estimate) ** 2)) / spread if spread > 0.0 else 0.0
    step = max(1, len(label) // AGREEMENT_POINTS)
    return Agreement(
        label[::step], estimate[::step], r_squared, slope, float(estimate.mean()) - slope * float(label.mean())
    )


@dataclass(frozen=True, eq=False)
class VelocityProfile:
    """Friction against velocity: the median in each bin of velocity [N], and the label's quartiles."""

    velocity_m_s: Array
    label_lower_n: Array
    label_upper_n: Array
    medians_n: dict[str, Array]


def velocity_profile(comparison: Comparison, condition: str, shown: Sequence[str]) -> VelocityProfile:
    """Compute the Stribeck map of a condition: bins of equal width that hold at least 20 usable rows."""
    traces = comparison.of_condition(condition)
    velocity = np.concatenate([trace.velocity_m_s[trace.usable] for trace in traces])
    lines = {"label": np.concatenate([trace.label_n[trace.usable] for trace in traces])}
    for name in shown:
        lines[name] = np.concatenate([trace.estimates_n[name][trace.usable] for trace in traces])
    reach = max(float(np.quantile(np.abs(velocity), 0.995)), 1e-6)
    edges = np.linspace(-reach, reach, VELOCITY_BINS + 1)
    bins = np.digitize(velocity, edges) - 1
    full = [index for index in range(VELOCITY_BINS) if int((bins == index).sum()) >= MINIMUM_ROWS_A_BIN]
    quartiles = np.array([np.quantile(lines["label"][bins == index], (0.25, 0.75)) for index in full]).reshape(-1, 2)
    medians = {name: np.array([np.median(values[bins == index]) for index in full]) for name, values in lines.items()}
    centres = 0.5 * (edges[1:] + edges[:-1])
    return VelocityProfile(centres[full], quartiles[:, 0], quartiles[:, 1], medians)
