"""The data of `dvc plots`."""

from __future__ import annotations

from pathlib import Path

import yaml

from cylinder_friction.evaluation.analysis import analyse
from cylinder_friction.reporting.figures import all_figures
from cylinder_friction.reporting.plot_data import plot_tables

ROOT = Path(__file__).parents[2]


def test_tables_have_equal_columns_in_every_row(compared, curves, strokes):
    truth = {recording.name: recording.column("friction_n") + 1.0 for recording in strokes}
    comparison = compared(truth, lugre=(30.0, 9.0), ridge=1.0, hybrid=(3.0, 2.0))
    tables = plot_tables(analyse(comparison, "hybrid", "lugre", curves, 4.0, 50))
    assert {"learning_curve_hybrid.csv", "residuals_lugre.csv"} <= set(tables)
    for text in tables.values():
        assert len({line.count(",") for line in text.splitlines()}) == 1
    assert tables["learning_curve_hybrid.csv"].splitlines()[2] == "2,20,25"
    assert tables["friction_over_time_condition_1.csv"].startswith("time_s,label_n,truth_n,lugre_n,hybrid_n\n")
    head, first, *rest = tables["errors_by_condition.csv"].splitlines()
    assert head.startswith("case,estimator,condition,label_percent,")
    assert first.startswith("lugre · 1,lugre,1,10.")
    assert len(rest) == 11


def test_plots_of_dvc_are_pictures_of_the_report_and_need_no_network(compared, curves):
    figures = all_figures(analyse(compared(lugre=30.0, hybrid=3.0), "hybrid", "lugre", curves, 4.0, 50))
    plots = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["plots"]
    assert {Path(path).stem for path in plots} <= set(figures)
    assert {Path(path).parent.as_posix() for path in plots} == {"reports/figures"}
    page = (ROOT / ".dvc/plots.html").read_text(encoding="utf-8")
    assert "{plot_divs}" in page
    assert "script" not in page
