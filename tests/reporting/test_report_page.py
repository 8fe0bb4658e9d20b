"""Figures and report: same data, same bytes; nothing from outside; every section there."""

from __future__ import annotations

import re

import numpy as np
import plotly.graph_objects as go
import pytest
from plotly.offline import get_plotlyjs

from cylinder_friction.evaluation.analysis import analyse
from cylinder_friction.evaluation.timing import StepTime, time_steps
from cylinder_friction.evaluation.views import LearningCurve, agreement, excerpt, histogram, velocity_profile
from cylinder_friction.reporting.figures import all_figures
from cylinder_friction.reporting.plot_data import plot_tables
from cylinder_friction.reporting.report.audit import audit_table
from cylinder_friction.reporting.report.page import Page
from cylinder_friction.reporting.report.report import ReportInputs, report_html
from cylinder_friction.reporting.style import png_bytes

AUDIT = {
    "rts": {"all": {"steady": {"mae_n": 6.5}, "events": {"mae_n": 24.0}}, "1": {"steady": {"mae_n": 77.25}}},
    "moving_average": {"all": {"steady": {"mae_n": 9.0}}},
}


@pytest.fixture(scope="module")
def analysis(compared, curves, strokes):
    truth = {recording.name: recording.column("friction_n") + 1.0 for recording in strokes}
    comparison = compared(truth, lugre=(30.0, 9.0), ridge=(1.0, 1.0), paper_hybrid=(9.0, 4.0), hybrid=(3.0, 2.0))
    return analyse(comparison, "hybrid", "lugre", curves, 4.0, 50)


@pytest.fixture(scope="module")
def page(analysis):
    times = {"hybrid": StepTime(10, 2e-6, 5e-6, 9e-6)}
    return report_html(analysis, ReportInputs(times, {"layers": [1, 2]}, {"layers": 1}, AUDIT))


@pytest.mark.slow
def test_every_figure_is_there_and_equal_data_are_equal_bytes(analysis):
    figures = all_figures(analysis)
    assert set(figures) == {
        "figure5_learning_curve",
        "figure6_friction_over_time",
        "figure7_residuals_hybrid",
        "figure8_estimated_against_calculated",
        "figure9_residuals_lugre",
        "quantiles",
        "autocorrelation",
        "errors_by_condition",
        "errors_by_condition_truth",
        "errors_by_stratum",
        "friction_against_velocity",
    }
    first = {name: png_bytes(figure) for name, figure in figures.items()}
    second = {name: png_bytes(figure) for name, figure in all_figures(analysis).items()}
    assert first == second
    for content in first.values():
        assert content.startswith(b"\x89PNG")
        assert b"Software" not in content


def test_without_truth_there_is_no_truth_figure_and_the_report_says_so(compared, curves):
    bare = analyse(compared(hybrid=1.0, lugre=2.0), "hybrid", "lugre", curves, 2.0, 20)
    assert "errors_by_condition_truth" not in all_figures(bare)
    page = report_html(bare, ReportInputs({}, {}, {}, None))
    assert "True friction is not known for these recordings." in page
    assert "Label audit" not in page


def test_the_report_loads_nothing_from_outside(page):
    assert page.count(get_plotlyjs()) == 1
    own = page.replace(get_plotlyjs(), "")
    assert not re.search(r"(src|href)\s*=\s*[\"']?\s*(https?:)?//", own)
    assert not re.search(r"@import|url\s*\(|<link|<iframe|<img", own)
    assert "http" not in own


def test_a_page_that_prints_goes_without_plotly_and_takes_no_figure_that_needs_it():
    page = Page("Title", "Lead.", interactive=False, head="<style>p { color: red; }</style>")
    page.text("Words.")
    assert get_plotlyjs() not in page.html()
    assert "<style>p { color: red; }</style></head>" in page.html()
    with pytest.raises(ValueError, match="expected an interactive page for the figure 'Friction', but got one without"):
        page.figure(go.Figure(), "Friction")


def test_no_button_offers_to_upload_the_data(page):
    assert "showSendToCloud: false" in page.replace(get_plotlyjs(), "")


def test_every_link_of_the_contents_leads_to_a_section(page):
    links = re.findall(r'href="#([^"]+)"', page)
    assert len(links) == 11
    assert all(f'id="{link}"' in page for link in links)


def test_the_report_holds_its_tables_figures_and_words(page, analysis):
    own = page.replace(get_plotlyjs(), "")
    for words in ("Table I:", "Table II:", "Table II, against true friction", "Table III", "Label audit", "Ljung–Box"):
        assert words in own
    for number in (5, 6, 8):
        assert f"Figure {number}:" in own
    assert "Figures 7 and 9" in own
    assert own.count("draw(&quot;") == 0
    assert own.count('<script>draw("figure-') == 9
    assert "ridge on lagged samples is better in tests 1, 2, 3 and 4" in own
    percent = analysis.comparison.percent("hybrid", "1")
    assert f"{percent:.2f} %" in own


def test_text_from_recordings_cannot_break_the_page(compared, curves, strokes):
    comparison = compared(**{"hybrid": 1.0, "lugre": 2.0, "</script><b>": 3.0})
    page = report_html(analyse(comparison, "hybrid", "lugre", curves, 2.0, 20), ReportInputs({}, {}, {}, None)).replace(
        get_plotlyjs(), ""
    )
    assert "</script><b>" not in page


def test_audit_rows_are_named_by_the_keys_that_lead_to_them():
    table = audit_table(AUDIT)
    assert table.head == ("", "MAE [N]")
    assert table.rows == (
        ("rts, all, steady", "6.50"),
        ("rts, all, events", "24.00"),
        ("rts, 1, steady", "77.25"),
        ("moving average, all, steady", "9.00"),
    )


def test_the_audit_shows_all_tests_at_once_first_and_each_in_a_fold(page):
    own = page.replace(get_plotlyjs(), "")
    audit = own[own.index(">Label audit</h2>") :]
    assert audit.count("6.50") == 2
    assert audit.index("9.00") < audit.index("<details>") < audit.index("77.25")


def test_an_audit_without_truth_says_its_note(analysis):
    page = report_html(analysis, ReportInputs({}, {}, {}, {"note": "true friction is unknown here"}))
    assert "true friction is unknown here" in page


def test_plot_tables_have_equal_columns_in_every_row(analysis):
    tables = plot_tables(analysis)
    assert {"learning_curve_hybrid.csv", "errors_by_condition.csv", "residuals_lugre.csv"} <= set(tables)
    for text in tables.values():
        assert len({line.count(",") for line in text.splitlines()}) == 1
    assert tables["learning_curve_hybrid.csv"].splitlines()[2] == "2,20,25"
    assert tables["friction_over_time_test_1.csv"].startswith("time_s,label_n,truth_n,lugre_n,hybrid_n\n")


def test_an_excerpt_is_the_stretch_with_most_motion_and_hides_what_is_not_usable(compared):
    part = excerpt(compared(hybrid=1.0, lugre=2.0), "1", ("hybrid",), 4.0)
    assert len(part.time_s) == 800
    assert part.time_s[0] == pytest.approx(0.05)  # the first ten rows are not usable
    assert part.residuals_n()["hybrid"] == pytest.approx(-1.0)


def test_the_views_agree_with_numbers_known_beforehand(compared):
    comparison = compared(hybrid=6.0, lugre=2.0)
    found = agreement(comparison, "hybrid", "1")
    assert found.slope == pytest.approx(1.0)
    assert found.intercept_n == pytest.approx(6.0)
    assert 0.999 < found.r_squared < 1.0
    profile = velocity_profile(comparison, "1", ("hybrid",))
    assert profile.medians_n["hybrid"] - profile.medians_n["label"] == pytest.approx(6.0, abs=0.1)
    counted = histogram(np.random.default_rng(0).normal(size=50_000))
    assert counted.density.sum() * counted.width_n == pytest.approx(1.0 - counted.outside, abs=1e-9)
    assert np.abs(counted.density - counted.normal_density).max() < 0.03


def test_a_learning_curve_that_is_not_one_is_refused():
    good = {"epoch": [1, 2], "train_mae_n": [2.0, 1.0], "validation_mae_n": [3.0, 2.0], "best_epoch": 2}
    assert LearningCurve.from_dict(good, "models/hybrid").best_epoch == 2
    with pytest.raises(ValueError, match="models/hybrid: 'train_mae_n' is missing; got"):
        LearningCurve.from_dict({"epoch": [1]}, "models/hybrid")
    with pytest.raises(ValueError, match="expected one value an epoch in every list, but got lengths"):
        LearningCurve.from_dict({**good, "epoch": [1]}, "models/hybrid")


def test_an_unknown_main_estimator_is_refused_by_name(compared, curves):
    with pytest.raises(KeyError, match="'hybrid' was not compared"):
        analyse(compared(ridge=1.0, lugre=2.0), "hybrid", "lugre", curves, 2.0, 20)


def test_steps_are_timed_one_at_a_time_and_a_slow_estimator_is_cut_short(strokes, labelled_recordings, cylinder):
    from cylinder_friction.estimators.linear import ForceBalanceEstimator

    estimator = ForceBalanceEstimator(cylinder, "none")
    estimator.fit(labelled_recordings[:1])
    found = time_steps(estimator, labelled_recordings[0], 60)
    assert found.steps == 60
    assert 0.0 < found.p50_s <= found.p99_s <= found.maximum_s
    assert time_steps(estimator, labelled_recordings[0], 1000, maximum_seconds=0.0).steps == 1
