"""The report: a comparison for a reader who has not seen the code."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from cylinder_friction.evaluation.analysis import Analysis
from cylinder_friction.evaluation.comparison import Comparison, Scores
from cylinder_friction.evaluation.coverage import Coverage
from cylinder_friction.evaluation.starts import Starts
from cylinder_friction.evaluation.timing import StepTime
from cylinder_friction.evaluation.views import Excerpt
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.reporting import comparison_tables as tables
from cylinder_friction.reporting import figures
from cylinder_friction.reporting.estimator_titles import phrase
from cylinder_friction.reporting.page import Line, PageFigure, Panel, Table, over_time, page_html
from cylinder_friction.reporting.print_figure import draw
from cylinder_friction.reporting.summary import CLEAR_POINTS, best_reference, summary

SECTIONS = {
    "summary": "Summary",
    "truth-errors": "Errors against true friction",
    "data": "The data",
    "training": "Training",
    "label-errors": "Errors against the label",
    "offsets": "Sensor offsets",
    "bounds": "Bounds",
    "over-time": "Friction over time",
    "residuals": "Residuals",
    "motion": "Where in the motion",
    "cost": "Cost of an estimate",
    "audit": "Label audit",
    "reading": "How to read the numbers",
}


DESIGNS = {"paper": "the published design", "force_balance": "the design that corrects the force balance"}


@dataclass(frozen=True)
class ReportInputs:
    """Contents of the report beside the analysis."""

    times: Mapping[str, StepTime]  # Measured seconds per step by estimator
    searched: Mapping[str, Any]  # Ranges of the hyperparameter search by name
    best: Mapping[str, Any]  # The best hyperparameters by name, and their ``design``
    finals: Sequence[Mapping[str, Any]]  # Finals of the search, from the search stage
    chosen: Mapping[str, Any]  # Hyperparameters that the main estimator was trained with by name
    # The label audit from the label stage, by filter, condition and stratum; None without one
    audit: dict[str, Any] | None
    offsets: Sequence[Mapping[str, Any]]  # Offsets of the sessions, from the offset stage; empty without any
    starts: Sequence[Starts]  # The main estimator from a cold and from a warm start; empty if it learns no offset
    bounds: str  # What lies between the main estimator's bounds, and why zeros were not corrected
    held: Sequence[Coverage]  # How often the main estimator's bounds hold label and truth; empty without bounds


def report_html(analysis: Analysis, inputs: ReportInputs) -> str:
    """Render the whole page; it loads nothing from outside."""
    comparison, main = analysis.comparison, analysis.main
    audit = inputs.audit
    there = {"audit": audit is not None, "offsets": bool(inputs.offsets), "bounds": bool(inputs.held)}
    left_out = {key for key, shown in there.items() if not shown}
    return page_html(
        "templates/report.html.j2",
        title="Friction estimators compared",
        sections={key: words for key, words in SECTIONS.items() if key not in left_out},
        recordings=len(comparison.traces),
        minutes=sum(len(trace.time_s) * trace.sample_time_s for trace in comparison.traces) / 60.0,
        comparison=comparison,
        summary=summary(comparison, main),
        main=phrase(main),
        rival=phrase(analysis.rival),
        instead="" if main == "paper_hybrid" else f", with {phrase(main)} of this project",
        clear_points=CLEAR_POINTS,
        opening=_opening(analysis),
        reference=_name(comparison, best_reference(comparison)[0]),
        data=tables.data_table(comparison),
        against=_against(analysis),
        label_warning=tables.label_warning(comparison),
        offsets=(draw(figures.session_offsets, inputs.offsets), tables.offset_table(inputs.offsets))
        if inputs.offsets
        else None,
        starts=tables.start_table(inputs.starts) if inputs.starts else None,
        coverage=tables.coverage_table(inputs.held),
        coverage_by_rows=tables.coverage_by_rows(inputs.held),
        bounds=inputs.bounds,
        differences=tables.difference_table(comparison, main),
        over_time={part.condition: (part.recording, _over_time(part)) for part in analysis.excerpts},
        panels=_panels(analysis),
        residuals=analysis.residuals[main],
        residual_tables=(tables.residual_shape_table(analysis), tables.residual_memory_table(analysis)),
        hyperparameters=tables.hyperparameter_table(inputs.searched, inputs.best, inputs.chosen),
        finals=tables.finals_table(inputs.finals),
        searched_design=DESIGNS.get(inputs.best.get("design", ""), "a design that is not recorded"),
        cost=tables.cost_table(comparison, inputs.times),
        audit=_audit(audit),
        audit_note=(audit or {}).get("note", ""),
    )


def _opening(analysis: Analysis) -> tuple[Figure, Figure]:
    """Draw the report's first picture: friction over time in the first and the last condition, and all errors."""
    comparison, shown = analysis.comparison, analysis.excerpts
    excerpts = shown if len(shown) < 2 else [shown[0], shown[-1]]
    scores, known = best_reference(comparison)
    errors = draw(figures.errors_by_condition, scores, known, _name(comparison, scores), analysis.main)
    return draw(figures.friction_over_time, excerpts), errors


def _name(comparison: Comparison, scores: Scores) -> str:
    return "true friction" if scores is comparison.truth else "label"


def _against(analysis: Analysis) -> dict[str, tuple[Table, dict[str, Table], Figure | None]]:
    """Collect by reference: Table II, folded tables by title, and the chart unless the page opens with it."""
    comparison = analysis.comparison
    opens, _ = best_reference(comparison)
    both = {
        "label": (comparison.label, comparison.conditions),
        "truth": (comparison.truth, comparison.truth_conditions),
    }
    found: dict[str, tuple[Table, dict[str, Table], Figure | None]] = {}
    for reference, (scores, conditions) in both.items():
        if scores:
            name = _name(comparison, scores)
            notes = tables.row_notes(comparison)
            table = tables.error_table(scores, conditions, name, notes, published=reference == "label")
            chart = draw(figures.errors_by_condition, scores, conditions, name, analysis.main)
            found[reference] = (table, _details(scores, conditions), None if scores is opens else chart)
    return found


def _details(scores: Scores, conditions: Sequence[str]) -> dict[str, Table]:
    each = {f"All measures, condition {condition}": tables.detail_table(scores, condition) for condition in conditions}
    return {"Each held-out session": tables.session_table(scores, conditions), **each}


def _over_time(part: Excerpt) -> PageFigure:
    """Draw friction and, below it, label minus estimate, to be zoomed into."""

    def lines(values: Mapping[str, Any], in_legend: bool) -> list[Line]:
        return [
            Line(
                figures.line_title(name),
                each,
                figures.line_colour(name),
                4.0 if name == "label" else 1.3,
                in_legend,
            )
            for name, each in values.items()
        ]

    panels = [
        Panel("friction [N]", lines(part.lines_n, True), 1.6),
        Panel("residual [N]", lines(part.residuals_n(), False), 0.8),
    ]
    return over_time(part.time_s, panels, legend_rows=2)


def _panels(analysis: Analysis) -> dict[str, list[Figure]]:
    """Collect the small pictures of each section, one per condition or estimator."""
    comparison = analysis.comparison
    each_condition = comparison.conditions
    return {
        "agreement": [
            draw(figures.estimated_against_calculated, analysis.main, {c: analysis.agreements[c]})
            for c in each_condition
        ],
        "velocity": [draw(figures.friction_against_velocity, {c: analysis.profiles[c]}) for c in each_condition],
        "strata": [draw(figures.errors_by_stratum, comparison, [c]) for c in each_condition],
        "histograms": [draw(figures.residual_histogram, *each) for each in analysis.histograms.items()],
        "quantiles": [draw(figures.quantile_plot, {name: points}) for name, points in analysis.quantiles.items()],
        "memories": [
            draw(figures.autocorrelation_plot, {name: memory}, analysis.sample_time_s)
            for name, memory in analysis.memories.items()
        ],
        "learning": [draw(figures.learning_curves, {name: curve}) for name, curve in analysis.curves.items()],
    }


def _audit(audit: dict[str, Any] | None) -> tuple[Table, ...]:
    """Tabulate the audit over all conditions and, below it, by condition."""
    if audit is None or "note" in audit:
        return ()
    groups: dict[tuple[str, ...], Mapping[str, Any]] = {
        (name, condition, stratum): numbers
        for name, conditions in audit.items()
        for condition, strata in conditions.items()
        for stratum, numbers in strata.items()
    }
    brief: dict[tuple[str, ...], Mapping[str, Any]] = {
        (name, stratum): each for (name, at, stratum), each in groups.items() if at == ALL_CONDITIONS
    }
    return tables.audit_table(brief), tables.audit_table(groups)
