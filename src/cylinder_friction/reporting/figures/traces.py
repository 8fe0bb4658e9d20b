"""Figure 6: friction over time in every test, and what each estimator leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.evaluation.names import TRACE_COLOURS, colour, title
from cylinder_friction.reporting.figures.style import panels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from cylinder_friction.evaluation.views import Excerpt

LINE_TITLES = {"label": "Calculated (label)", "truth": "True friction"}
LINE_WIDTHS = {"label": 3.0, "truth": 0.9}
ESTIMATE_WIDTH = 1.1


def line_title(name: str) -> str:
    return LINE_TITLES.get(name, title(name))


def line_colour(name: str) -> str:
    return TRACE_COLOURS.get(name, colour(name))


def friction_over_time(excerpts: Sequence[Excerpt]) -> Figure:
    """Return two panels a test: friction (label, truth where known, estimates) and, below, label minus estimate."""
    figure, axes = panels(2 * len(excerpts), 1, 9.5, 3.1 * len(excerpts) + 0.5, heights=[3.0, 1.3] * len(excerpts))
    for part, force, residual in zip(excerpts, axes[::2], axes[1::2], strict=True):
        for name, values in part.lines_n.items():
            width = LINE_WIDTHS.get(name, ESTIMATE_WIDTH)
            force.plot(part.time_s, values, color=line_colour(name), linewidth=width, label=line_title(name))
        for name, values in part.residuals_n().items():
            residual.plot(part.time_s, values, color=line_colour(name), linewidth=0.8)
        force.set(title=f"condition {part.condition}  ({part.recording})", ylabel="friction [N]")
        residual.set_ylabel("residual [N]")
        force.tick_params(labelbottom=False)
        for axis in (force, residual):
            axis.set_xlim(float(part.time_s[0]), float(part.time_s[-1]))
    axes[-1].set_xlabel("time [s]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure
