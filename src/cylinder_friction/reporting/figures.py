"""Figures of a comparison and of one estimate, drawn by Matplotlib without a display."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.analysis import Analysis
from cylinder_friction.evaluation.comparison import Comparison, Scores, equal_to_label, mean_percent
from cylinder_friction.evaluation.strata import STRATA
from cylinder_friction.evaluation.views import Agreement, Excerpt, Histogram, LearningCurve, VelocityProfile
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.estimator_titles import REFERENCES, TRACE_COLOURS, colour, title
from cylinder_friction.reporting.print_figure import draw, grid_of, panels
from cylinder_friction.reporting.style import (
    BLACK,
    BLUE,
    BROWN,
    CONDITION_MARKS,
    GREEN,
    INK,
    ORANGE,
    PALE,
    PINK,
    QUIET,
    SKY,
    YELLOW,
)

PANEL = (4.8, 3.3)  # Width and height of one panel [in], so that letters are legible on a screen of 400 pixels
LINE_WIDTHS = {"label": 3.0, "truth": 0.9}
ESTIMATE_WIDTH = 1.1

STRATA_SHADES = {
    "lugre": ORANGE,
    "pressure_lugre": YELLOW,
    "pressure_lugre_all": BROWN,
    "force_balance_low_pass": GREEN,
    "ridge": PINK,
    "paper_hybrid": SKY,
    "hybrid": BLUE,
}
"""Estimators whose errors are drawn by stratum, and their colours."""

ROLE_COLOURS = {"train": QUIET, "validation": SKY, "calibration": GREEN, "test": BLUE}

_TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)


class BoundedEstimate(Protocol):
    """An estimate with its bounds [N], each of shape ``(n,)``."""

    @property
    def friction_n(self) -> Array: ...
    @property
    def lower_n(self) -> Array: ...
    @property
    def upper_n(self) -> Array: ...


def plot(recording: Recording, estimate: Array | BoundedEstimate | None = None, truth_n: Array | None = None) -> Figure:
    """Draw friction over time: label and truth if there are any, the estimate and its bounds.

    The scale is that of the usable rows: at end stops an estimate may be many times as large.

    Args:
        recording: The estimated recording; its column ``friction_n`` is the label, drawn in usable rows.
        estimate: Estimated friction [N], shape ``(n,)``, alone or with its bounds.
        truth_n: True friction [N], shape ``(n,)``.

    Raises:
        ValueError: An estimate or the truth has another length than the recording.

    Example:
        >>> figure = cf.plot(test[0], hybrid.estimate(test[0]))
        >>> figure.savefig("friction.png")
    """
    return draw(_plot, recording, estimate, truth_n)


def _plot(recording: Recording, estimate: Array | BoundedEstimate | None, truth_n: Array | None) -> Figure:
    time_s = recording.column("time_s")
    lines: dict[str, Any] = {}
    if "friction_n" in recording.columns:
        label_n = recording.column("friction_n")
        lines["label"] = np.where(recording.usable(), label_n, np.nan) if "usable" in recording.columns else label_n
    if truth_n is not None:
        lines["truth"] = truth_n
    if estimate is not None and not hasattr(estimate, "friction_n"):
        estimate = np.asarray(estimate, dtype=np.float64)
    if estimate is not None:
        lines["estimate"] = getattr(estimate, "friction_n", estimate)
    figure, (axis,) = panels(1, 1, 9.5, 3.6)
    if estimate is not None and not isinstance(estimate, np.ndarray):
        lower_n, upper_n = estimate.lower_n, estimate.upper_n
        axis.fill_between(time_s, lower_n, upper_n, color=BLUE, alpha=0.18, linewidth=0, label="bounds")
    for name, values in lines.items():
        if np.shape(values) != time_s.shape:
            raise ValueError(
                f"{name}: got shape {np.shape(values)}, expected {time_s.shape}, one value per sample of recording "
                f"{recording.name!r}; estimate this recording again"
            )
    _friction_lines(axis, time_s, lines)
    axis.set(title=recording.name, xlabel="time [s]", ylabel="friction [N]")
    axis.margins(y=0.12)
    usable = recording.usable()
    shown_n = np.concatenate([np.empty(0), *(np.asarray(values)[usable] for values in lines.values())])
    if np.isfinite(shown_n).any():
        lowest_n, highest_n = np.nanmin(shown_n), np.nanmax(shown_n)
        slack_n = 0.12 * (highest_n - lowest_n) or 1.0
        axis.set_ylim(lowest_n - slack_n, highest_n + slack_n)
    if lines:
        axis.legend(ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    return figure


def _friction_lines(axis: Axes, time_s: Array, lines_n: Mapping[str, Array]) -> None:
    for name, values in lines_n.items():
        width = LINE_WIDTHS.get(name, ESTIMATE_WIDTH)
        axis.plot(time_s, values, color=line_colour(name), linewidth=width, label=line_title(name))
    axis.set_xlim(float(time_s[0]), float(time_s[-1]))


def all_figures(analysis: Analysis) -> dict[str, Figure]:
    """Collect every figure; its key is its file's name without ``.png``.

    ``errors_by_condition_truth`` is missing if true friction is not known.
    """
    comparison, main, rival = analysis.comparison, analysis.main, analysis.rival
    figures = {
        "figure5_learning_curve": draw(learning_curves, analysis.curves),
        "figure6_friction_over_time": draw(friction_over_time, analysis.excerpts, width=9.5),
        f"figure7_residuals_{main}": draw(residual_histogram, main, analysis.histograms[main]),
        "figure8_estimated_against_calculated": draw(estimated_against_calculated, main, analysis.agreements),
        f"figure9_residuals_{rival}": draw(residual_histogram, rival, analysis.histograms[rival]),
        "quantiles": draw(quantile_plot, analysis.quantiles),
        "autocorrelation": draw(autocorrelation_plot, analysis.memories, analysis.sample_time_s),
        "errors_by_condition": draw(errors_by_condition, comparison.label, comparison.conditions, "label", main),
        "errors_by_stratum": draw(errors_by_stratum, comparison, comparison.conditions),
        "friction_against_velocity": draw(friction_against_velocity, analysis.profiles),
    }
    if comparison.truth:
        figures["errors_by_condition_truth"] = draw(
            errors_by_condition, comparison.truth, comparison.truth_conditions, "true friction", main
        )
    return figures


def friction_over_time(excerpts: Sequence[Excerpt], width: float = PANEL[0]) -> Figure:
    """Draw two panels per condition: friction (label, known truth, estimates), and label minus estimate."""
    figure, axes = panels(2 * len(excerpts), 1, width, 2.4 * len(excerpts) + 0.3, [3.0, 1.3] * len(excerpts))
    for part, force, residual in zip(excerpts, axes[::2], axes[1::2], strict=True):
        _friction_lines(force, part.time_s, part.lines_n)
        for name, values in part.residuals_n().items():
            residual.plot(part.time_s, values, color=line_colour(name), linewidth=0.8)
        force.set(title=f"Condition {part.condition}", ylabel="friction [N]")
        residual.set_ylabel("residual [N]")
        force.tick_params(labelbottom=False)
        residual.set_xlim(force.get_xlim())
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels(axes)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2 if width < 6.0 else 4)
    return figure


def errors_by_condition(scores: Scores, conditions: Sequence[str], against: str, main: str) -> Figure:
    """Draw one row per estimator, on a log scale: each condition's error, interval and sessions.

    A mark is the error of a condition, the line through it the 95 % interval, and each stroke a session; ``main`` is
    shaded. An estimator that equals the label by construction has no marks.
    """
    names = [name for name in scores if scores[name]]
    figure, (axis,) = panels(1, 1, PANEL[0], 0.5 * len(names) + 0.9)
    spread = np.linspace(-0.04, 0.36, max(2, len(conditions)))
    for row, name in enumerate(names):
        found = [scores[name][condition] for condition in conditions if condition in scores[name]]
        equal = name in equal_to_label(scores)
        for index, condition in enumerate(conditions):
            if equal or condition not in scores[name]:
                continue
            score, (shade, marker, _) = scores[name][condition], CONDITION_MARKS[index % len(CONDITION_MARKS)]
            place = row + float(spread[index])
            sessions = list(score.sessions.percent.values())
            axis.plot(mean_percent(scores[name], [condition])[1:], [place] * 2, color=shade, linewidth=1.6, alpha=0.55)
            axis.plot(sessions, [place] * len(sessions), "|", color=shade, markersize=5.0, markeredgewidth=0.8)
            axis.plot(score.errors.percent, place, marker, color=shade, markersize=4.2, markeredgewidth=0)
        low, high = (end(score.errors.percent for score in found) for end in (min, max))
        strong: dict[str, Any] = {"fontweight": "bold"} if name == main else {}
        where: dict[str, Any] = {"transform": axis.get_yaxis_transform(), "va": "center", "fontsize": 8.5}
        axis.text(0.0, row - 0.32, title(name), ha="left", **where, **strong)
        words = "equals the label by construction" if equal else f"{low:.2f} – {high:.2f} %"
        axis.text(1.0, row - 0.32, words, ha="right", **where, **strong)
        axis.axhline(row - 0.5, color=PALE, linewidth=0.4)
        if name == main:
            axis.axhspan(row - 0.5, row + 0.5, color=BLUE, alpha=0.09, linewidth=0)
    axis.set(xscale="log", ylim=(len(names) - 0.5, -0.5), yticks=[])
    axis.set_xlabel(f"MAE [% of the condition's mean |{against}|]")
    axis.xaxis.set_major_locator(FixedLocator(_TICKS))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter("{x:g}")
    axis.spines["left"].set_visible(False)
    denominators = [_denominator_n(scores, condition) for condition in conditions]
    handles = [
        axis.plot([], [], marker, color=shade, label=f"condition {condition} ({denominator:.0f} N)")[0]
        for (shade, marker, _), condition, denominator in zip(
            CONDITION_MARKS * (1 + len(conditions) // len(CONDITION_MARKS)), conditions, denominators, strict=False
        )
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=2, title=None, handletextpad=0.2)
    return figure


def _denominator_n(scores: Scores, condition: str) -> float:
    return next(found[condition].errors.mean_abs_friction_n for found in scores.values() if condition in found)


def errors_by_stratum(comparison: Comparison, conditions: Sequence[str]) -> Figure:
    """Draw one panel per condition: the mean absolute error [N] of some estimators within each stratum."""
    shown = [name for name in STRATA_SHADES if name in comparison.estimators] or list(comparison.estimators)
    figure, axes = grid_of(len(conditions), *PANEL)
    width = 0.8 / len(shown)
    for axis, condition in zip(axes, conditions, strict=True):
        for index, name in enumerate(shown):
            strata = comparison.label[name][condition].strata
            present = [position for position, stratum in enumerate(STRATA) if stratum in strata]
            heights = [strata[stratum].mae_n for stratum in STRATA if stratum in strata]
            places = [position + (index - 0.5 * (len(shown) - 1)) * width for position in present]
            axis.bar(places, heights, width=width, color=STRATA_SHADES.get(name, QUIET), label=title(name))
        axis.set_xticks(range(len(STRATA)), [fill(words, 10) for words in STRATA.values()], fontsize=7.5)
        axis.set(title=f"Condition {condition}", ylabel="MAE against the label [N]")
        axis.grid(visible=False, axis="x")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2, fontsize=7.5)
    return figure


def estimated_against_calculated(name: str, found: Mapping[str, Agreement]) -> Figure:
    """Draw one panel per condition: estimate over label, the line y = x, and R²."""
    figure, axes = grid_of(len(found), *PANEL)
    for axis, (condition, points) in zip(axes, found.items(), strict=True):
        ends = [float(points.label_n.min()), float(points.label_n.max())]
        axis.plot(points.label_n, points.estimate_n, ".", color=colour(name), ms=2.5, alpha=0.4, rasterized=True)
        axis.plot(ends, ends, color=BLACK, linewidth=1.0, label="y = x")
        words = f"R² = {points.r_squared:.4f}\nslope {points.slope:.3f}\nintercept {points.intercept_n:z.1f} N"
        axis.text(0.04, 0.96, words, transform=axis.transAxes, va="top", fontsize=8.5)
        axis.set(title=f"Condition {condition}", xlabel="label [N]", ylabel=f"{title(name)} [N]")
        axis.legend(loc="lower right")
    return figure


def friction_against_velocity(profiles: Mapping[str, VelocityProfile]) -> Figure:
    """Draw one panel per condition: the median friction at each velocity, the label's middle half shaded."""
    figure, axes = grid_of(len(profiles), *PANEL)
    for axis, (condition, profile) in zip(axes, profiles.items(), strict=True):
        velocity = 1e3 * profile.velocity_m_s
        band: dict[str, Any] = {"color": PALE, "alpha": 0.4, "linewidth": 0, "label": "label, middle half"}
        axis.fill_between(velocity, profile.label_lower_n, profile.label_upper_n, **band)
        for name, values in profile.medians_n.items():
            width, marker = LINE_WIDTHS.get(name, ESTIMATE_WIDTH), "" if name in LINE_WIDTHS else "o"
            axis.plot(
                velocity, values, color=line_colour(name), lw=width, marker=marker, ms=2.5, label=line_title(name)
            )
        axis.axhline(0.0, color=PALE, linewidth=0.8)
        axis.axvline(0.0, color=PALE, linewidth=0.8)
        axis.set(title=f"Condition {condition}", xlabel="velocity [mm/s]", ylabel="median friction [N]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2)
    return figure


def learning_curves(curves: Mapping[str, LearningCurve]) -> Figure:
    """Draw one panel per hybrid: training and validation error per epoch, their gap, and the chosen epoch."""
    figure, axes = grid_of(len(curves), *PANEL)
    for axis, (name, curve) in zip(axes, curves.items(), strict=True):
        epochs, train = np.array(curve.epoch), np.array(curve.train_mae_n)
        validation = np.array(curve.validation_mae_n)
        axis.fill_between(epochs, train, validation, color=SKY, alpha=0.25, linewidth=0, label="gap")
        axis.plot(epochs, train, color=BLUE, label="training")
        axis.plot(epochs, validation, color=ORANGE, label="validation")
        if curve.best_epoch in curve.epoch:
            kept = float(validation[curve.epoch.index(curve.best_epoch)])
            axis.plot(
                curve.best_epoch, kept, "o", color=BLACK, ms=5, label=f"kept: epoch {curve.best_epoch}, {kept:.1f} N"
            )
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter("{x:g}")
        axis.tick_params(axis="y", which="minor", labelsize=7)
        axis.set(title=title(name), xlabel="epoch", ylabel="MAE against the label [N]")
        axis.legend()
    return figure


def residual_histogram(name: str, counted: Histogram) -> Figure:
    """Draw the histogram of one estimator's residuals with the normal curve and the quartiles."""
    figure, (axis,) = panels(1, 1, *PANEL)
    axis.bar(counted.centres_n, counted.density, width=counted.width_n, color=colour(name), alpha=0.55, linewidth=0)
    axis.plot(counted.centres_n, counted.normal_density, color=BLACK, label="normal, same mean and deviation")
    lower, median, upper = counted.quartiles_n
    axis.axvline(median, color=INK, linewidth=1.4, label=f"median {median:z.1f} N")
    axis.axvline(lower, color=INK, linewidth=1.0, linestyle="--", label=f"quartiles {lower:.1f} and {upper:.1f} N")
    axis.axvline(upper, color=INK, linewidth=1.0, linestyle="--")
    axis.set(
        title=title(name),
        xlabel=f"label minus estimate [N]   ({100 * counted.outside:.1f} % lie outside)",
        ylabel="density [1/N]",
        ylim=(0.0, 1.45 * float(max(counted.density.max(), counted.normal_density.max()))),
    )
    axis.legend(loc="upper right")
    return figure


def quantile_plot(points: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Draw one Q-Q panel per estimator: residual quantiles against those of a normal distribution."""
    figure, axes = grid_of(len(points), *PANEL)
    for axis, (name, (normal, found)) in zip(axes, points.items(), strict=True):
        ends = [float(normal.min()), float(normal.max())]
        axis.plot(ends, ends, color=BLACK, linewidth=1.0, label="normal")
        axis.plot(normal, found, ".", color=colour(name), markersize=4, label="residuals")
        axis.set(title=title(name), xlabel="normal quantile [N]", ylabel="residual quantile [N]")
        axis.legend()
    return figure


def autocorrelation_plot(memories: Mapping[str, tuple[Array, float]], sample_time_s: float) -> Figure:
    """Draw the residuals' autocorrelation; an entry holds the values from lag 0 and the 95 % band's half width."""
    figure, axes = grid_of(len(memories), *PANEL)
    for axis, (name, (memory, band)) in zip(axes, memories.items(), strict=True):
        axis.axhspan(-band, band, color=PALE, alpha=0.6, linewidth=0, label="independent, 95 %")
        axis.plot(1e3 * sample_time_s * np.arange(len(memory)), memory, color=colour(name))
        axis.axhline(0.0, color=BLACK, linewidth=0.8)
        axis.set(title=title(name), xlabel="lag [ms]", ylabel="autocorrelation of residuals", ylim=(-0.6, 1.05))
        axis.legend()
    return figure


def line_title(name: str) -> str:
    return REFERENCES.get(name, title(name))


def line_colour(name: str) -> str:
    return TRACE_COLOURS.get(name, colour(name))


def session_offsets(sessions: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the sensors' offset of each session with two standard uncertainties, beside the stated zeros."""
    figure, (axis,) = panels(1, 1, PANEL[0], 1.2 * PANEL[1])
    ordered = sorted(sessions, key=lambda each: (each["condition"], each["session"]))
    stated_n = 2.0 * max(each["prior_n"] for each in ordered)
    axis.axhspan(-stated_n, stated_n, color=PALE, alpha=0.35, lw=0.0, label="stated zeros")
    for role, shade in ROLE_COLOURS.items():
        own = [place for place, each in enumerate(ordered) if each["role"] == role]
        if own:
            offsets_n = [ordered[place]["offset_n"] for place in own]
            bars_n = [2.0 * ordered[place]["standard_uncertainty_n"] for place in own]
            axis.errorbar(own, offsets_n, bars_n, fmt="o", ms=2.5, lw=1.0, color=shade, label=role)
    conditions = [each["condition"] for each in ordered]
    firsts = [conditions.index(condition) for condition in sorted(set(conditions))]
    axis.set_xticks(firsts, [f"condition {conditions[first]}" for first in firsts], ha="left")
    axis.set_ylabel("offset in friction [N]")
    axis.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.1))
    return figure
