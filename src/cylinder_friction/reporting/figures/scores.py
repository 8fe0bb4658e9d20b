"""Errors of every estimator: by test with intervals, and by stratum."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.ticker import FixedLocator, NullLocator

from cylinder_friction.evaluation.names import FAMILY_COLOURS, colour, naming, title
from cylinder_friction.evaluation.strata import STRATA
from cylinder_friction.reporting.figures.style import panels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from cylinder_friction.evaluation.comparison import Comparison, Scores

STRATA_SHOWN = ("lugre", "pressure_lugre", "force_balance_low_pass", "ridge", "paper_hybrid", "hybrid")
STRATA_SHADES = ("#D55E00", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#0072B2")
"""Estimators whose errors are shown within strata, and their colours."""

_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)


def errors_by_condition(scores: Scores, conditions: Sequence[str], against: str) -> Figure:
    """Return one panel a test: every estimator's error [% of mean |friction|] with its 95 % interval, log scale."""
    columns = 2 if len(conditions) > 1 else 1
    rows = -(-len(conditions) // columns)
    names = [name for name in scores if scores[name]]
    figure, axes = panels(rows, columns, 5.4 * columns, (0.26 * len(names) + 0.9) * rows + 0.4)
    for axis in axes[len(conditions) :]:
        axis.set_visible(False)
    for index, (axis, condition) in enumerate(zip(axes, conditions, strict=False)):
        here = [name for name in names if condition in scores[name]]
        for row, name in enumerate(reversed(here)):
            score = scores[name][condition]
            low, high = score.interval_percent
            percent = score.errors.percent
            axis.plot([low, high], [row, row], color=colour(name), linewidth=2.4, alpha=0.5, solid_capstyle="butt")
            axis.plot(percent, row, "o", color=colour(name), markersize=5)
            axis.annotate(f"{percent:.2f}", (high, row), (4, -3), textcoords="offset points", fontsize=7.5)
        axis.set_xscale("log")
        axis.xaxis.set_major_locator(FixedLocator(_TICKS))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.xaxis.set_major_formatter("{x:g}")
        axis.margins(x=0.14)
        axis.set_yticks(range(len(here)), [title(name) for name in reversed(here)] if index % columns == 0 else [])
        denominator = scores[here[0]][condition].errors.mean_abs_friction_n
        axis.set(title=f"condition {condition}", xlabel=f"MAE [% of mean |{against}| = {denominator:.0f} N]")
    families = dict.fromkeys(naming(name).family for name in names)
    handles = [axes[0].plot([], [], "o", color=FAMILY_COLOURS[family], label=family)[0] for family in families]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(families))
    return figure


def errors_by_stratum(comparison: Comparison, shown: Sequence[str]) -> Figure:
    """Return one panel a test: the mean absolute error [N] of the shown estimators within each stratum."""
    columns = 2 if len(comparison.conditions) > 1 else 1
    rows = -(-len(comparison.conditions) // columns)
    figure, axes = panels(rows, columns, 5.2 * columns, 2.6 * rows + 0.4)
    for axis in axes[len(comparison.conditions) :]:
        axis.set_visible(False)
    width = 0.8 / len(shown)
    for axis, condition in zip(axes, comparison.conditions, strict=False):
        for index, name in enumerate(shown):
            strata = comparison.label[name][condition].strata
            present = [position for position, stratum in enumerate(STRATA) if stratum in strata]
            heights = [strata[stratum].mae_n for stratum in STRATA if stratum in strata]
            places = [position + (index - 0.5 * (len(shown) - 1)) * width for position in present]
            axis.bar(places, heights, width=width, color=STRATA_SHADES[index % len(STRATA_SHADES)], label=title(name))
        axis.set_xticks(range(len(STRATA)), [words.replace(" ", "\n", 1) for words in STRATA.values()], fontsize=7.5)
        axis.set(title=f"condition {condition}", ylabel="MAE against the label [N]")
        axis.grid(visible=False, axis="x")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(3, len(labels)))
    return figure
