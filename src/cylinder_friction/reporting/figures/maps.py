"""Figure 8 and the Stribeck map: estimated against calculated friction, and friction against velocity."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.evaluation.names import colour, title
from cylinder_friction.reporting.figures.style import panels
from cylinder_friction.reporting.figures.traces import ESTIMATE_WIDTH, LINE_WIDTHS, line_colour, line_title

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from cylinder_friction.evaluation.views import Agreement, VelocityProfile


def estimated_against_calculated(name: str, found: Mapping[str, Agreement]) -> Figure:
    """Return one panel a test: estimate over label, the line y = x, and R²."""
    columns = 2 if len(found) > 1 else 1
    rows = -(-len(found) // columns)
    figure, axes = panels(rows, columns, 4.2 * columns, 3.8 * rows)
    for axis in axes[len(found) :]:
        axis.set_visible(False)
    for axis, (condition, points) in zip(axes, found.items(), strict=False):
        ends = [float(points.label_n.min()), float(points.label_n.max())]
        axis.plot(points.label_n, points.estimate_n, ".", color=colour(name), markersize=2.5, alpha=0.4)
        axis.plot(ends, ends, color="#000000", linewidth=1.0, label="y = x")
        words = f"R² = {points.r_squared:.4f}\nslope {points.slope:.3f}\nintercept {points.intercept_n:.1f} N"
        axis.text(0.04, 0.96, words, transform=axis.transAxes, va="top", fontsize=8.5)
        axis.set(
            title=f"condition {condition}", xlabel="calculated friction (label) [N]", ylabel="estimated friction [N]"
        )
        axis.legend(loc="lower right")
    figure.suptitle(title(name), fontsize=10.0)
    return figure


def friction_against_velocity(profiles: Mapping[str, VelocityProfile]) -> Figure:
    """Return one panel a test: the median friction at each velocity, with the label's middle half shaded."""
    columns = 2 if len(profiles) > 1 else 1
    rows = -(-len(profiles) // columns)
    figure, axes = panels(rows, columns, 5.0 * columns, 3.0 * rows + 0.4)
    for axis in axes[len(profiles) :]:
        axis.set_visible(False)
    for axis, (condition, profile) in zip(axes, profiles.items(), strict=False):
        velocity = 1e3 * profile.velocity_m_s
        axis.fill_between(
            velocity,
            profile.label_lower_n,
            profile.label_upper_n,
            color="#000000",
            alpha=0.13,
            linewidth=0,
            label="label, middle half",
        )
        for name, values in profile.medians_n.items():
            width = LINE_WIDTHS.get(name, ESTIMATE_WIDTH)
            marker = "" if name in LINE_WIDTHS else "o"
            axis.plot(
                velocity, values, color=line_colour(name), lw=width, marker=marker, ms=2.5, label=line_title(name)
            )
        axis.axhline(0.0, color="#888888", linewidth=0.7)
        axis.axvline(0.0, color="#888888", linewidth=0.7)
        axis.set(title=f"condition {condition}", xlabel="velocity [mm/s]", ylabel="median friction [N]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(4, len(labels)))
    return figure
