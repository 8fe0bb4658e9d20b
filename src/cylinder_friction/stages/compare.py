"""Stage ``compare``: every estimator on the held-out recordings, as metrics, figures, tables and one report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import TYPE_CHECKING, Any

import cylinder_friction.estimators  # noqa: F401 - makes every kind of estimator known to `load`
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.evaluation.analysis import Analysis, analyse
from cylinder_friction.evaluation.comparison import ComparisonSettings, compare
from cylinder_friction.evaluation.coverage import Coverage, by_condition, coverage
from cylinder_friction.evaluation.headline import headline
from cylinder_friction.evaluation.known_notes import notes_of
from cylinder_friction.evaluation.metric_tree import MetricTree, metric_rows, metric_tree
from cylinder_friction.evaluation.reported import error_metrics, reported_errors
from cylinder_friction.evaluation.starts import Starts, starts
from cylinder_friction.evaluation.timing import StepTime, time_steps
from cylinder_friction.evaluation.truth import known_truth
from cylinder_friction.evaluation.views import LearningCurve
from cylinder_friction.execution.progress import progress
from cylinder_friction.files.whole_files import read_json, whole_folder, write_json, write_text
from cylinder_friction.realtime.model import Bounds
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.reporting.comparison_tables import markdown_tables
from cylinder_friction.reporting.figures import all_figures
from cylinder_friction.reporting.plot_data import plot_tables
from cylinder_friction.reporting.print_figure import png_bytes
from cylinder_friction.reporting.report import ReportInputs, report_html
from cylinder_friction.reporting.summary import summary
from cylinder_friction.run_record import RunRecord, by_columns
from cylinder_friction.stages._stage import (
    AUDIT_FILE,
    BEST_FILE,
    CHOSEN_FILE,
    COVERAGE_FILE,
    FILTERS_FILE,
    FINALS_FILE,
    HEADLINE_FILE,
    HYBRID_FOLDER,
    INGESTED_FILE,
    METRICS_FILE,
    OFFSET_FILE,
    PAPER_HYBRID_FOLDER,
    PROCESSED_FOLDERS,
    REPORTS_FOLDER,
    SPACE_FILE,
    artifacts,
    datasets,
    estimator_folders,
    flat,
)
from cylinder_friction.wording import counted

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params

ENOUGH_SESSIONS = 9
"""Calibration sessions from which bounds are hardly wider than from many: Student's t is then 1.13 times the normal."""
TIMINGS_FILE = REPORTS_FOLDER / "timings.json"
STARTS_FILE = REPORTS_FOLDER / "starts.json"
TABLE_FILE = REPORTS_FOLDER / "table.md"
REPORT_FILE = REPORTS_FOLDER / "report.html"
FIGURES_FOLDER = REPORTS_FOLDER / "figures"
PLOTS_FOLDER = REPORTS_FOLDER / "plots"
FILES = (METRICS_FILE, TIMINGS_FILE, STARTS_FILE, COVERAGE_FILE, TABLE_FILE, REPORT_FILE)
WRITTEN = (*FILES, FIGURES_FOLDER, PLOTS_FOLDER)
COMPARED_BY = {field.name for field in fields(ComparisonSettings)}
LEARNING_CURVE_FILE = "learning_curve.json"
RIVAL = "lugre"


def run(params: Params) -> RunRecord:
    """Read the models, ``data/processed/test`` and the true friction; write ``reports/`` except ``reports/runs``.

    Raises:
        FileNotFoundError: A model or the test recordings do not exist.
        RecordingError: See ``evaluation.comparison.compare``; or true friction does not fit its recording.
    """
    settings, main = params.compare, params.compare.main
    recordings = read_stored(PROCESSED_FOLDERS["test"])
    estimators = load_estimators()
    truth_n = known_truth(read_json(INGESTED_FILE)["truth"], recordings)
    comparison = replace(
        compare(estimators, recordings, ComparisonSettings(**settings.model_dump(include=COMPARED_BY)), truth_n),
        notes=notes_of(estimators, recordings, read_json(FILTERS_FILE)["method"]),
    )
    curves = {
        path.parent.name: LearningCurve(**read_json(path))
        for path in (HYBRID_FOLDER / LEARNING_CURVE_FILE, PAPER_HYBRID_FOLDER / LEARNING_CURVE_FILE)
    }
    analysis = analyse(comparison, main, RIVAL, curves, settings.figure_duration_s, settings.autocorrelation_lags)
    times = {
        name: time_steps(estimator, recordings[0], settings.timing_repeats)
        for name, estimator in progress(estimators.items(), "time steps", unit="estimator")
    }
    tree = metric_tree(comparison)
    reference, errors_percent = reported_errors(tree[main])
    held = coverage(estimators[main], recordings, truth_n, settings.reversal_window_s)
    begun = starts(estimators[main], recordings, truth_n)
    _write(analysis, times, tree, begun, held, estimators[main].bounds)
    write_json(HEADLINE_FILE, headline(tree, held, main))
    return RunRecord(
        name="compare",
        params=flat(settings) | {"reference": reference},
        metrics=error_metrics(errors_percent, reference)
        | {f"held_by_bounds_percent/condition_{name}": share for name, share in by_condition(held, reference).items()},
        tables={"errors_by_condition": by_columns(metric_rows(tree)), "bounds": by_columns(map(asdict, held))},
        note="\n".join(f"- {finding}" for finding in summary(comparison, main)),
        artifacts=artifacts(*WRITTEN),
        datasets=datasets({"test": PROCESSED_FOLDERS["test"]}),
    )


def load_estimators() -> dict[str, FrictionEstimator]:
    """Load every estimator that the pipeline made, by name.

    Raises:
        FileNotFoundError: An estimator is missing.
    """
    return {name: load_estimator(folder) for name, folder in estimator_folders().items()}


def _few(sessions: Sequence[Mapping[str, Any]]) -> str:
    """State that few calibration sessions widen the bounds; empty if there are enough."""
    roles = Counter(str(each["role"]) for each in sessions)
    count = roles["calibration"] or roles["validation"]
    if not 0 < count < ENOUGH_SESSIONS:
        return ""
    words = counted(count, "calibration session")
    return f". They rest on {words}, and are wider for it (Student's t)"


def _write(
    analysis: Analysis,
    times: dict[str, StepTime],
    tree: MetricTree,
    begun: Sequence[Starts],
    held: Sequence[Coverage],
    bounds: Bounds | None,
) -> None:
    offsets = read_json(OFFSET_FILE)
    left_alone = offsets["left_alone_because"]
    inputs = ReportInputs(
        times,
        searched=read_json(SPACE_FILE),
        best=read_json(BEST_FILE),
        finals=read_json(FINALS_FILE),
        chosen=read_json(HYBRID_FOLDER.with_name(analysis.main) / CHOSEN_FILE),
        audit=read_json(AUDIT_FILE) if AUDIT_FILE.is_file() else None,
        offsets=offsets["sessions"],
        starts=begun,
        bounds=("" if bounds is None else bounds.in_words() + _few(offsets["sessions"]))
        + (f". The sensors' zeros were left alone: {left_alone}" if left_alone else "")
        + (f". {loss}" if (loss := offsets.get("loss", "")) else ""),
        held=held,
    )
    report = report_html(analysis, inputs)
    with whole_folder(FIGURES_FOLDER) as folder:
        for name, figure in progress(all_figures(analysis).items(), "figures", unit="figure"):
            (folder / f"{name}.png").write_bytes(png_bytes(figure))
    with whole_folder(PLOTS_FOLDER) as folder:
        for name, text in plot_tables(analysis).items():
            write_text(folder / name, text)
    write_text(REPORT_FILE, report)
    write_text(TABLE_FILE, markdown_tables(analysis.comparison, published=analysis.main == PAPER_HYBRID_FOLDER.name))
    write_json(TIMINGS_FILE, {name: asdict(time) for name, time in times.items()})
    write_json(STARTS_FILE, [asdict(each) for each in begun])
    write_json(COVERAGE_FILE, [{"estimator": analysis.main, **asdict(each)} for each in held])
    write_json(METRICS_FILE, tree)
