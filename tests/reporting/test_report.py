"""Figures and report: same data, same bytes; nothing from outside; every section there."""

from __future__ import annotations

import re

import pytest

from cylinder_friction.evaluation.analysis import analyse
from cylinder_friction.evaluation.coverage import Coverage
from cylinder_friction.evaluation.starts import Starts
from cylinder_friction.evaluation.timing import StepTime
from cylinder_friction.reporting.figures import all_figures
from cylinder_friction.reporting.page import static
from cylinder_friction.reporting.print_figure import png_bytes
from cylinder_friction.reporting.report import ReportInputs, report_html

PLOTLY = static("plotly-basic.min.js")
AUDIT = {
    "rts": {"all": {"steady": {"mae_n": 6.5}, "events": {"mae_n": 24.0}}, "1": {"steady": {"mae_n": 77.25}}},
    "moving_average": {"all": {"steady": {"mae_n": 9.0}}},
}

STARTS = Starts("1", "truth", 6, 410.0, 1.75, 1.25)
SESSION = {
    "session": "s-t1_2",
    "role": "test",
    "condition": "1",
    "offset_n": 7.25,
    "standard_uncertainty_n": 2.9,
    "common_uncertainty_n": 2.6,
    "prior_n": 12.0,
    "strokes_extend": 20,
    "strokes_retract": 30,
    "sliding_s": 55.0,
}
FINALS = [
    {"params": {"layers": 1, "nodes": 16}, "errors_n": [6.0, 6.5], "multiply_adds": 2000},
    {"params": {"layers": 1, "nodes": 48}, "errors_n": [5.5, 5.6], "multiply_adds": 11268},
]
NOTHING = ReportInputs({}, {}, {}, [], {}, None, [], [], "", [])
HOLD = "they hold friction, as made up here"
HELD = [
    Coverage("truth", "condition", "1", 4000, 90.25, 42.5),
    Coverage("truth", "session", "s-t1_2", 2000, 81.75, 44.25),
    Coverage("truth", "speed", "up to 12 mm/s", 1000, 86.5, 40.0),
    Coverage("label", "session", "s-l1_9", 2000, 92.25, 44.25),
]


@pytest.fixture(scope="module")
def analysis(compared, curves, strokes):
    truth = {recording.name: recording.column("friction_n") + 1.0 for recording in strokes}
    comparison = compared(truth, lugre=(30.0, 9.0), ridge=(1.0, 1.0), paper_hybrid=(9.0, 4.0), hybrid=(3.0, 2.0))
    return analyse(comparison, "hybrid", "lugre", curves, 4.0, 50)


@pytest.fixture(scope="module")
def page(analysis):
    times = {"hybrid": StepTime(10, 2e-6, 5e-6, 9e-6)}
    return report_html(
        analysis,
        ReportInputs(
            times, {"layers": [1, 2]}, {"layers": 1}, FINALS, {"layers": 1}, AUDIT, [SESSION], [STARTS], HOLD, HELD
        ),
    )


@pytest.fixture(scope="module")
def bare(compared, curves):
    """No truth, no audit, no bounds, and an estimator whose name is markup."""
    return analyse(compared(**{"hybrid": 1.0, "lugre": 2.0, "</script><b>": 3.0}), "hybrid", "lugre", curves, 2.0, 20)


@pytest.fixture(scope="module")
def bare_page(bare):
    return report_html(bare, NOTHING)


@pytest.mark.extended
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
    first, second = ([png_bytes(each) for each in made.values()] for made in (figures, all_figures(analysis)))
    assert first == second


def test_bounds_offsets_and_audit_are_there_where_they_are_known(page, bare, bare_page):
    for title, numbers in {
        "the worst first": ("90.2", "42.5", "session s-t1_2", "81.8", "speed up to 12 mm/s", "86.5"),
        "Sensor offsets": ("20 / 30", "7.2", "Cold [% of mean |true friction|]", "1.25"),
        "Label audit": ("6.50", "9.00", "77.25"),
    }.items():
        assert [words for words in (title, *numbers) if words not in page] == []
        assert title not in bare_page
    assert page.index("session s-t1_2") < page.index("speed up to 12 mm/s")
    assert "s-l1_9" not in page, "of the label, if truth is known"
    assert page.index("5.50 to 5.60") < page.index("6.00 to 6.50"), "the search's choice comes first"
    assert "errors_by_condition_truth" not in all_figures(bare)
    assert "True friction is not known for these recordings." in bare_page


def test_the_report_loads_nothing_from_outside_and_offers_no_upload(page):
    assert page.count(PLOTLY) == 1
    own = page.replace(PLOTLY, "")
    assert not re.search(r"(src|href)\s*=\s*[\"']?\s*(https?:)?//", own)
    assert not re.search(r"@import|url\s*\((?!#)|<link|<iframe|<img", own)
    assert "http" not in own
    assert "showSendToCloud: false" in own


def test_every_link_of_the_contents_leads_to_a_section(page):
    links = re.findall(r'<a href="#([^"]+)"', page)
    assert len(links) == 13
    assert all(page.count(f'id="{link}"') == 1 for link in links)


def test_the_report_holds_its_tables_figures_and_words(page, analysis):
    numbered = re.findall(r"<h3>((?:Table|Figure) \w+)[:,]", page)
    assert numbered == ["Table I", "Figure 5", "Table II", *(f"Figure {n}" for n in (6, 7, 8, 9)), "Table III"]
    assert "Figure 8, with the hybrid of this project: estimated against calculated" in page
    assert page.count("<details open") == 0, "the answer is above, all else is folded"
    for words in ("Label audit", "Ljung–Box"):
        assert words in page
    assert page.count('class="plot"') == 4
    assert "ridge on lagged samples is clearly better" in page
    percent = analysis.comparison.percent("hybrid", "1")
    assert f"{percent:.2f} %" in page


@pytest.mark.extended
def test_a_browser_draws_it_wide_and_narrow(tmp_path, page, new_page):
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    for width in (1400, 400):
        shown = new_page(width)
        errors: list[str] = []
        shown.on("pageerror", lambda error, found=errors: found.append(str(error)))
        shown.goto(path.as_uri())
        plot = shown.locator(".plot").first
        shown.evaluate("location.hash = 'over-time'")
        plot.scroll_into_view_if_needed()
        plot.locator(".main-svg").first.wait_for()
        assert shown.evaluate("document.documentElement.scrollWidth") == width
        widths = "Array.from(document.querySelectorAll('main figure'), figure => figure.clientWidth)"
        assert min(each for each in shown.evaluate(widths) if each) > 300
        shown.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        assert shown.evaluate("document.querySelectorAll('details:not([open])').length") == 0
        drawn = "Array.from(document.querySelectorAll('.plot .main-svg:first-of-type'), each => each.clientWidth)"
        assert set(shown.evaluate(drawn)) == {690}, "as wide as paper"
        shown.evaluate("window.dispatchEvent(new Event('afterprint'))")
        assert shown.evaluate("document.querySelectorAll('details.section[open]').length") == 1
        assert errors == []


def test_text_from_recordings_cannot_break_the_page(bare_page):
    assert "&lt;/script&gt;&lt;b&gt;" in bare_page
    assert "</script><b>" not in bare_page.replace(PLOTLY, "")


@pytest.mark.extended
def test_where_an_estimator_equals_the_label_the_report_warns_and_shows_none_of_its_residuals(compared, curves, page):
    comparison = compared(force_balance_paper=0.0, paper_hybrid=3.0, hybrid=1.0, lugre=40.0)
    shown = report_html(analyse(comparison, "paper_hybrid", "lugre", curves, 2.0, 20), NOTHING)
    sections = dict(
        re.findall(r'(?s)<details class="section" id="([\w-]+)">(.*?)(?=<details class="section"|$)', shown)
    )
    errors, rest = sections["label-errors"], sections["residuals"]
    assert "of this project" not in shown, "the paper's own hybrid"
    assert "this states nothing about friction" in errors
    assert "Force balance, moving averages<small>(equals the label by construction)</small>" in errors
    assert "The hybrid as published against the label" in rest
    assert "Force balance, moving averages" not in rest
    assert "this states nothing about friction" not in page
