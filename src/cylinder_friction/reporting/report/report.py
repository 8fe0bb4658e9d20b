"""The report: what the comparison found, for a reader who has not seen the code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cylinder_friction.reporting.comparison_tables import (
    cost_table,
    data_table,
    detail_table,
    error_table,
    hyperparameter_table,
    residual_memory_table,
    residual_shape_table,
)
from cylinder_friction.reporting.estimator_titles import phrase
from cylinder_friction.reporting.report import interactive
from cylinder_friction.reporting.report.audit import audit_table
from cylinder_friction.reporting.report.page import Page
from cylinder_friction.reporting.summary import summary

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cylinder_friction.evaluation.analysis import Analysis
    from cylinder_friction.evaluation.comparison import Scores
    from cylinder_friction.evaluation.timing import StepTime


ALL_TESTS = "all"
"""In the label audit: all tests together."""


@dataclass(frozen=True)
class ReportInputs:
    """What the report says beside the analysis.

    Attributes:
        times: Measured seconds a step by estimator.
        searched: Ranges of the hyperparameter search by name.
        chosen: Hyperparameters of the default hybrid by name.
        audit: The label audit, as the label stage wrote it: by filter, test and stratum; None where there is none.
    """

    times: Mapping[str, StepTime]
    searched: Mapping[str, Any]
    chosen: Mapping[str, Any]
    audit: dict[str, Any] | None


def report_html(analysis: Analysis, inputs: ReportInputs) -> str:
    """Return the whole page; it loads nothing from outside."""
    comparison = analysis.comparison
    recordings = len(comparison.traces)
    minutes = sum(len(trace.time_s) * trace.sample_time_s for trace in comparison.traces) / 60.0
    page = Page(
        "Friction estimators compared",
        f"{len(comparison.estimators)} estimators on {recordings} held-out recordings, {minutes:.1f} minutes in all. "
        "No estimator has seen them in training or tuning.",
    )
    page.section("Summary")
    page.points(summary(comparison, analysis.main), "summary")
    _data(page, analysis)
    _label_errors(page, analysis)
    _truth_errors(page, analysis)
    _over_time(page, analysis)
    _motion(page, analysis)
    _residuals(page, analysis)
    _training(page, analysis, inputs)
    _cost(page, analysis, inputs)
    _label_audit(page, inputs)
    _definitions(page)
    return page.html()


def _data(page: Page, analysis: Analysis) -> None:
    page.section("The data")
    page.text(
        "Recordings are held out by session. Rows near the end stops are not usable: there, the equation of motion "
        "gives the wall's reaction."
    )
    page.table(data_table(analysis.comparison))


def _label_errors(page: Page, analysis: Analysis) -> None:
    comparison = analysis.comparison
    page.section("Errors against the label")
    page.heading("Table II: mean absolute error by test")
    page.text(
        "The label is friction calculated off line from the equation of motion. Percentages are of the mean absolute "
        "label of the same test, written in the head. The smallest error of a test is marked."
    )
    page.table(error_table(comparison.label, comparison.conditions, "label", published=True))
    page.figure(
        interactive.errors_by_condition(comparison.label, comparison.conditions, "label"),
        "Error of every estimator with its 95 % block-bootstrap interval; logarithmic scale.",
    )
    _details(page, comparison.label, comparison.conditions)


def _truth_errors(page: Page, analysis: Analysis) -> None:
    truth = analysis.comparison.truth
    page.section("Errors against true friction")
    if not truth:
        page.text("True friction is not known for these recordings. Only a simulated rig can know it.")
        return
    conditions = tuple(sorted({condition for scores in truth.values() for condition in scores}))
    page.heading("Table II, against true friction")
    page.text(
        "The simulated rig knows its true friction, which no estimator was taught by. The denominator is the mean "
        "absolute true friction on the same rows. The label itself is judged, too: it looks ahead, estimators do not."
    )
    page.table(error_table(truth, conditions, "true friction"))
    page.figure(
        interactive.errors_by_condition(truth, conditions, "true friction"),
        "Error against true friction with its 95 % block-bootstrap interval; logarithmic scale.",
    )
    _details(page, truth, conditions)


def _details(page: Page, scores: Scores, conditions: tuple[str, ...]) -> None:
    for condition in conditions:
        page.folded(f"All measures, condition {condition}", detail_table(scores, condition))


def _over_time(page: Page, analysis: Analysis) -> None:
    page.section("Friction over time")
    page.figure(
        interactive.friction_over_time(analysis),
        "Figure 6: the stretch of each test with most motion, and below it label minus estimate. Gaps are rows that "
        "are not usable. Click a name to hide it.",
    )
    page.figure(
        interactive.estimated_against_calculated(analysis),
        f"Figure 8: {phrase(analysis.main)} against the label. R² is that of the line y = x; the slope is fitted.",
    )


def _motion(page: Page, analysis: Analysis) -> None:
    page.section("Where in the motion")
    page.figure(
        interactive.friction_against_velocity(analysis),
        "Friction against velocity (Stribeck map): medians in bins of velocity.",
    )
    page.figure(
        interactive.errors_by_stratum(analysis.comparison),
        "Mean absolute error against the label at rest, near zero velocity, sliding, just after a reversal, and by "
        "direction. Click a name to hide it.",
    )


def _residuals(page: Page, analysis: Analysis) -> None:
    page.section("Residuals")
    page.figure(
        interactive.residual_histograms(analysis),
        "Figures 7 and 9: residuals over all tests; vertical lines are the quartiles.",
    )
    main = analysis.residuals[analysis.main]
    page.text(
        "A bell-shaped histogram does not show that residuals are independent; the autocorrelation does or does not. "
        f"The {main.rows:,} residuals of {phrase(analysis.main)} carry as much information about their mean as "
        f"{main.effective_rows:,.0f} independent ones would. With so many rows every test of normality or independence "
        "rejects: judge the size of skewness, kurtosis and autocorrelation."
    )
    page.figure(interactive.quantiles_and_memory(analysis), "Quantiles and autocorrelation of the residuals.")
    page.heading("Distribution")
    page.table(residual_shape_table(analysis))
    page.heading("Memory, and what is left to explain")
    page.table(residual_memory_table(analysis))


def _training(page: Page, analysis: Analysis, inputs: ReportInputs) -> None:
    page.section("Training")
    page.heading("Table I: hyperparameters")
    page.table(hyperparameter_table(inputs.searched, inputs.chosen))
    if analysis.curves:
        page.figure(
            interactive.learning_curves(analysis),
            "Figure 5: mean absolute error after each epoch.",
        )


def _cost(page: Page, analysis: Analysis, inputs: ReportInputs) -> None:
    page.section("Cost of an estimate")
    page.heading("Table III")
    page.text(
        "Multiply-adds are counted (for a forest: comparisons). Times are measured here, one sample at a time through "
        "Python on one machine; they differ from run to run. The published times come from another machine."
    )
    page.table(cost_table(analysis.comparison, inputs.times))


def _label_audit(page: Page, inputs: ReportInputs) -> None:
    if inputs.audit is None:
        return
    page.section("Label audit")
    if "note" in inputs.audit:
        page.text(f"{inputs.audit['note']}")
        return
    page.text(
        "How far the label is from true friction, for each way of filtering: over all rows, in steady motion, and "
        "within the event window of starts, stops and reversals. Recordings of training, validation and test alike."
    )
    brief = {name: conditions[ALL_TESTS] for name, conditions in inputs.audit.items() if ALL_TESTS in conditions}
    page.table(audit_table(brief or inputs.audit))
    if brief:
        page.folded("By test", audit_table(inputs.audit))


def _definitions(page: Page) -> None:
    page.section("How to read the numbers")
    page.points(
        [
            "MAE: mean absolute error in newtons. Percent: MAE divided by the mean absolute reference friction of the "
            "same rows.",
            "Bias: mean of estimate minus reference. Residual: label minus estimate, as in the paper.",
            "Fit: 100 · (1 − |e| / |y − mean(y)|), with Euclidean norms over all rows.",
            "Lag: the shift at which the estimate correlates best with the reference; positive is late.",
            "95 % interval: block bootstrap; blocks of consecutive rows are drawn with replacement, the same ones for "
            "every estimator. It covers chance within these recordings, not a change of cylinder or session.",
            "A difference is called clear when the interval of the paired difference leaves out zero.",
            "Errors against the label and against true friction never stand in one column: they answer different "
            "questions.",
        ]
    )
