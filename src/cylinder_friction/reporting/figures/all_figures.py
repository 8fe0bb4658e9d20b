"""Every figure by its file's name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.reporting.figures.learning import learning_curves
from cylinder_friction.reporting.figures.maps import estimated_against_calculated, friction_against_velocity
from cylinder_friction.reporting.figures.residual_plots import autocorrelation_plot, quantile_plot, residual_histogram
from cylinder_friction.reporting.figures.scores import STRATA_SHOWN, errors_by_condition, errors_by_stratum
from cylinder_friction.reporting.figures.style import draw
from cylinder_friction.reporting.figures.traces import friction_over_time

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cylinder_friction.evaluation.findings import Findings


def all_figures(findings: Findings) -> dict[str, Figure]:
    """Return every figure; its key is its file's name without ``.png``.

    ``errors_by_condition_truth`` is there only where true friction is known.
    """
    comparison, main, rival = findings.comparison, findings.main, findings.rival
    shown = [name for name in STRATA_SHOWN if name in comparison.estimators] or [rival, main]
    figures = {
        "figure5_learning_curve": draw(learning_curves, findings.curves),
        "figure6_friction_over_time": draw(friction_over_time, findings.excerpts),
        f"figure7_residuals_{main}": draw(residual_histogram, main, findings.histograms[main]),
        "figure8_estimated_against_calculated": draw(estimated_against_calculated, main, findings.agreements),
        f"figure9_residuals_{rival}": draw(residual_histogram, rival, findings.histograms[rival]),
        "quantiles": draw(quantile_plot, findings.quantiles),
        "autocorrelation": draw(autocorrelation_plot, findings.memories, findings.sample_time_s),
        "errors_by_condition": draw(errors_by_condition, comparison.label, comparison.conditions, "label"),
        "errors_by_stratum": draw(errors_by_stratum, comparison, shown),
        "friction_against_velocity": draw(friction_against_velocity, findings.profiles),
    }
    if comparison.truth:
        known = sorted({condition for scores in comparison.truth.values() for condition in scores})
        figures["errors_by_condition_truth"] = draw(errors_by_condition, comparison.truth, known, "true friction")
    return figures
