"""The main figures as plotly figures, for the report."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from cylinder_friction.evaluation.strata import STRATA
from cylinder_friction.reporting.estimator_titles import colour, naming, title
from cylinder_friction.reporting.figures import STRATA_SHADES as SHADES
from cylinder_friction.reporting.figures import line_colour, line_title

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.evaluation.analysis import Analysis
    from cylinder_friction.evaluation.comparison import Comparison, Scores

STRATA_SHOWN, STRATA_SHADES = tuple(SHADES), tuple(SHADES.values())
_TICKS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200]
_COLUMNS = 2


def _thin(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Single precision halves the page and is finer than a pixel."""
    return values.astype(np.float32)


def _grid(count: int, titles: Sequence[str], height: int, **options: Any) -> go.Figure:
    columns = min(_COLUMNS, count)
    rows = -(-count // columns)
    figure = make_subplots(rows=rows, cols=columns, subplot_titles=list(titles), **options)
    return figure.update_layout(height=height * rows + 90)


def _cell(index: int, count: int) -> dict[str, int]:
    columns = min(_COLUMNS, count)
    return {"row": index // columns + 1, "col": index % columns + 1}


def errors_by_condition(scores: Scores, conditions: Sequence[str], against: str) -> go.Figure:
    """Return every estimator's error and its 95 % interval, one panel a test, log scale."""
    names = list(scores)
    figure = _grid(
        len(conditions),
        [f"condition {condition}" for condition in conditions],
        24 * len(names) + 80,
        shared_yaxes=True,
        horizontal_spacing=0.04,
        vertical_spacing=0.16,
    )
    for index, condition in enumerate(conditions):
        found = [scores[name][condition] for name in reversed(names)]
        percents = np.array([score.errors.percent for score in found])
        intervals = np.array([score.interval_percent for score in found])
        figure.add_trace(
            go.Scatter(
                x=percents,
                y=[title(name) for name in reversed(names)],
                mode="markers",
                marker={"size": 9, "color": [colour(name) for name in reversed(names)]},
                error_x={
                    "type": "data",
                    "symmetric": False,
                    "array": intervals[:, 1] - percents,
                    "arrayminus": percents - intervals[:, 0],
                    "color": "#999999",
                },
                customdata=[
                    (score.errors.mae_n, *score.interval_percent, naming(name).family)
                    for name, score in zip(reversed(names), found, strict=True)
                ],
                hovertemplate="%{y}<br>%{x:.2f} % (%{customdata[0]:.1f} N)<br>"
                "95 %: %{customdata[1]:.2f} – %{customdata[2]:.2f} %<extra></extra>",
                showlegend=False,
            ),
            **_cell(index, len(conditions)),
        )
        denominator = found[0].errors.mean_abs_friction_n
        short = against.removeprefix("true ")
        figure.update_xaxes(
            title_text=f"MAE [% of mean |{short}| = {denominator:.0f} N]", **_cell(index, len(conditions))
        )
    return figure.update_xaxes(type="log", tickvals=_TICKS, ticktext=[f"{tick:g}" for tick in _TICKS])


def friction_over_time(analysis: Analysis) -> go.Figure:
    """Return Figure 6: two panels a test (friction, and label minus estimate), one legend for all."""
    parts = analysis.excerpts
    titles = [words for part in parts for words in (f"condition {part.condition} ({part.recording})", "")]
    figure = make_subplots(
        rows=2 * len(parts),
        cols=1,
        subplot_titles=titles,
        row_heights=[3.0, 1.3] * len(parts),
        vertical_spacing=0.17 / len(parts),
    )
    for index, part in enumerate(parts):
        for row, lines in ((2 * index + 1, part.lines_n), (2 * index + 2, part.residuals_n())):
            for name, values in lines.items():
                figure.add_trace(
                    go.Scatter(
                        x=_thin(part.time_s),
                        y=_thin(values),
                        mode="lines",
                        name=line_title(name),
                        legendgroup=name,
                        showlegend=row == 1,
                        line={"color": line_colour(name), "width": 4.0 if name == "label" else 1.3},
                    ),
                    row=row,
                    col=1,
                )
        figure.update_yaxes(title_text="friction [N]", row=2 * index + 1, col=1)
        figure.update_yaxes(title_text="residual [N]", row=2 * index + 2, col=1)
        figure.update_xaxes(matches=f"x{2 * index + 1}" if index else "x", row=2 * index + 2, col=1)
    figure.update_xaxes(title_text="time [s]", row=2 * len(parts), col=1)
    return figure.update_layout(height=360 * len(parts) + 80, hovermode="x")


def learning_curves(analysis: Analysis) -> go.Figure:
    """Return Figure 5: training and validation error an epoch, one panel a hybrid."""
    curves = analysis.curves
    figure = _grid(len(curves), [title(name) for name in curves], 320, horizontal_spacing=0.1)
    for index, curve in enumerate(curves.values()):
        cell = _cell(index, len(curves))
        lines = (("training", "#0072B2", curve.train_mae_n), ("validation", "#D55E00", curve.validation_mae_n))
        for words, shade, values in lines:
            figure.add_trace(
                go.Scatter(
                    x=curve.epoch,
                    y=values,
                    name=words,
                    legendgroup=words,
                    showlegend=index == 0,
                    line={"color": shade},
                ),
                **cell,
            )
        figure.add_vline(x=curve.best_epoch, line={"color": "#555555", "dash": "dot", "width": 1}, **cell)
        figure.update_xaxes(title_text="epoch (dotted: the one kept)", **cell)
        figure.update_yaxes(title_text="MAE against the label [N]", type="log", **cell)
    return figure


def residual_histograms(analysis: Analysis) -> go.Figure:
    """Return Figures 7 and 9: residuals of both, each with its normal curve and quartiles."""
    figure = _grid(2, [title(name) for name in analysis.histograms], 360, horizontal_spacing=0.1)
    for index, (name, counted) in enumerate(analysis.histograms.items()):
        cell = _cell(index, 2)
        figure.add_trace(
            go.Bar(x=counted.centres_n, y=counted.density, marker_color=colour(name), opacity=0.6, showlegend=False),
            **cell,
        )
        figure.add_trace(
            go.Scatter(
                x=counted.centres_n,
                y=counted.normal_density,
                name="normal, same mean and deviation",
                legendgroup="normal",
                showlegend=index == 0,
                line={"color": "#000000"},
            ),
            **cell,
        )
        for quartile, dash in zip(counted.quartiles_n, ("dash", "solid", "dash"), strict=True):
            figure.add_vline(x=quartile, line={"color": "#444444", "dash": dash, "width": 1.3}, **cell)
        figure.update_xaxes(title_text="label minus estimate [N]", **cell)
        figure.update_yaxes(title_text="density [1/N]", **cell)
    return figure.update_layout(bargap=0.0)


def quantiles_and_memory(analysis: Analysis) -> go.Figure:
    """Return the Q-Q plot and the autocorrelation of the residuals of both."""
    figure = _grid(2, ["Quantiles against normal", "Autocorrelation"], 360, horizontal_spacing=0.1)
    for name, (normal, found) in analysis.quantiles.items():
        figure.add_trace(
            go.Scatter(
                x=normal,
                y=found,
                mode="markers",
                name=title(name),
                legendgroup=name,
                marker={"color": colour(name), "size": 5},
            ),
            row=1,
            col=1,
        )
        ends = [float(normal.min()), float(normal.max())]
        figure.add_trace(
            go.Scatter(x=ends, y=ends, mode="lines", showlegend=False, line={"color": "#555555", "width": 1}),
            row=1,
            col=1,
        )
    for name, (memory, _) in analysis.memories.items():
        lags_ms = 1e3 * analysis.sample_time_s * np.arange(len(memory))
        figure.add_trace(
            go.Scatter(x=lags_ms, y=memory, legendgroup=name, showlegend=False, line={"color": colour(name)}),
            row=1,
            col=2,
        )
    band = next(iter(analysis.memories.values()))[1]
    figure.add_hrect(y0=-band, y1=band, fillcolor="#888888", opacity=0.4, line_width=0, row=1, col=2)
    figure.update_xaxes(title_text="normal quantile [N]", row=1, col=1)
    figure.update_yaxes(title_text="residual quantile [N]", row=1, col=1)
    figure.update_xaxes(title_text="lag [ms]   (band: independent residuals, 95 %)", row=1, col=2)
    return figure.update_yaxes(title_text="autocorrelation", row=1, col=2)


def estimated_against_calculated(analysis: Analysis) -> go.Figure:
    """Return Figure 8: one panel a test, with y = x and R²."""
    conditions = analysis.agreements
    titles = [
        f"condition {condition}: R² = {points.r_squared:.4f}, slope {points.slope:.3f}"
        for condition, points in conditions.items()
    ]
    figure = _grid(len(conditions), titles, 380, horizontal_spacing=0.1, vertical_spacing=0.13)
    for index, points in enumerate(conditions.values()):
        cell = _cell(index, len(conditions))
        figure.add_trace(
            go.Scattergl(
                x=_thin(points.label_n),
                y=_thin(points.estimate_n),
                mode="markers",
                showlegend=False,
                marker={"color": colour(analysis.main), "size": 3, "opacity": 0.45},
            ),
            **cell,
        )
        ends = [float(points.label_n.min()), float(points.label_n.max())]
        figure.add_trace(
            go.Scatter(
                x=ends, y=ends, mode="lines", name="y = x", showlegend=index == 0, line={"color": "#000000", "width": 1}
            ),
            **cell,
        )
        figure.update_xaxes(title_text="calculated friction (label) [N]", **cell)
        figure.update_yaxes(title_text="estimated friction [N]", **cell)
    return figure


def friction_against_velocity(analysis: Analysis) -> go.Figure:
    """Return the Stribeck map: median friction at each velocity, one panel a test."""
    profiles = analysis.profiles
    figure = _grid(
        len(profiles),
        [f"condition {condition}" for condition in profiles],
        300,
        horizontal_spacing=0.1,
        vertical_spacing=0.15,
    )
    for index, profile in enumerate(profiles.values()):
        cell = _cell(index, len(profiles))
        for name, values in profile.medians_n.items():
            figure.add_trace(
                go.Scatter(
                    x=1e3 * profile.velocity_m_s,
                    y=values,
                    mode="lines+markers",
                    name=line_title(name),
                    legendgroup=name,
                    showlegend=index == 0,
                    line={"color": line_colour(name), "width": 4.0 if name == "label" else 1.3},
                    marker={"size": 4},
                ),
                **cell,
            )
        figure.update_xaxes(title_text="velocity [mm/s]", **cell)
        figure.update_yaxes(title_text="median friction [N]", **cell)
    return figure


def errors_by_stratum(comparison: Comparison) -> go.Figure:
    """Return the error of some estimators within each stratum, one panel a test."""
    conditions = comparison.conditions
    shown = [name for name in STRATA_SHOWN if name in comparison.estimators] or list(comparison.estimators)
    figure = _grid(
        len(conditions),
        [f"condition {condition}" for condition in conditions],
        300,
        horizontal_spacing=0.08,
        vertical_spacing=0.18,
    )
    for index, condition in enumerate(conditions):
        for name, shade in zip(shown, itertools.cycle(STRATA_SHADES)):
            strata = comparison.label[name][condition].strata
            present = [stratum for stratum in STRATA if stratum in strata]
            figure.add_trace(
                go.Bar(
                    x=[STRATA[stratum].replace(" ", "<br>", 1) for stratum in present],
                    y=[strata[stratum].mae_n for stratum in present],
                    name=title(name),
                    legendgroup=name,
                    showlegend=index == 0,
                    marker_color=shade,
                ),
                **_cell(index, len(conditions)),
            )
        figure.update_yaxes(title_text="MAE [N]", **_cell(index, len(conditions)))
    return figure.update_xaxes(tickangle=0, tickfont_size=10).update_layout(margin_t=110)
