"""The contents of figures and report, computed once from a comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.comparison import Comparison, with_gaps
from cylinder_friction.evaluation.residuals import (
    ResidualFigures,
    autocorrelation,
    dependence,
    quantile_points,
    residual_figures,
)
from cylinder_friction.evaluation.views import (
    Agreement,
    Excerpt,
    Histogram,
    LearningCurve,
    VelocityProfile,
    agreement,
    excerpt,
    histogram,
    velocity_profile,
)


@dataclass(frozen=True, eq=False)
class Analysis:
    """A comparison and all results that are derived from it."""

    comparison: Comparison  # The comparison that the rest is derived from
    main: str  # The estimator in question (the hybrid)
    rival: str  # The model beside it (LuGre)
    curves: Mapping[str, LearningCurve]  # Learning curve of each hybrid
    excerpts: list[Excerpt]  # Friction over time, one per condition
    agreements: dict[str, Agreement]  # Estimated against calculated friction of ``main``, by condition
    profiles: dict[str, VelocityProfile]  # Friction against velocity, by condition
    residuals: dict[str, ResidualFigures]  # Figures of every estimator's residuals over all conditions
    dependences: dict[str, dict[str, float]]  # Correlation of every estimator's residuals with each input
    # Autocorrelations of ``main`` and ``rival``, with the half width of the 95 % band of independent residuals
    histograms: dict[str, Histogram]
    quantiles: dict[str, tuple[Array, Array]]
    memories: dict[str, tuple[Array, float]]

    @property
    def sample_time_s(self) -> float:
        return self.comparison.traces[0].sample_time_s


def analyse(
    comparison: Comparison, main: str, rival: str, curves: Mapping[str, LearningCurve], duration_s: float, lags: int
) -> Analysis:
    """Analyse a comparison, with excerpts of ``duration_s`` and ``lags`` samples of autocorrelation.

    Raises:
        KeyError: ``main`` or ``rival`` was not compared.
    """
    for name in (main, rival):
        if name not in comparison.estimators:
            raise KeyError(f"{name!r} was not compared; got {list(comparison.estimators)}")
    pair = (rival, main)
    series = {name: comparison.residuals(name) for name in comparison.estimators}
    inputs = _inputs(comparison)
    return Analysis(
        comparison=comparison,
        main=main,
        rival=rival,
        curves=curves,
        excerpts=[excerpt(comparison, condition, pair, duration_s) for condition in comparison.conditions],
        agreements={condition: agreement(comparison, main, condition) for condition in comparison.conditions},
        profiles={condition: velocity_profile(comparison, condition, pair) for condition in comparison.conditions},
        residuals={name: residual_figures(values, usable) for name, (values, usable) in series.items()},
        dependences={name: dependence(values, usable, inputs) for name, (values, usable) in series.items()},
        histograms={name: histogram(series[name][0][series[name][1]]) for name in pair},
        quantiles={name: quantile_points(series[name][0][series[name][1]]) for name in pair},
        memories={
            name: (
                autocorrelation(series[name][0], series[name][1], lags),
                1.96 / math.sqrt(int(series[name][1].sum())),
            )
            for name in pair
        },
    )


def _inputs(comparison: Comparison) -> dict[str, Array]:
    """Collect the inputs that residuals may depend on, laid out like ``Comparison.residuals``."""
    masks = [trace.usable for trace in comparison.traces]
    columns = {
        "velocity": [trace.velocity_m_s for trace in comparison.traces],
        "speed": [np.abs(trace.velocity_m_s) for trace in comparison.traces],
        "pressure 1": [trace.pressure_1_pa for trace in comparison.traces],
        "pressure 2": [trace.pressure_2_pa for trace in comparison.traces],
    }
    return {name: with_gaps(parts, masks, 1)[0] for name, parts in columns.items()}
