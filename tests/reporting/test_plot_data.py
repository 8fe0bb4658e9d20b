"""The data of `dvc plots`."""

from __future__ import annotations

from pathlib import Path

import yaml

from cylinder_friction.evaluation.analysis import analyse
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


def test_dvc_draws_every_plot_from_a_column_that_is_written(compared, curves):
    tables = plot_tables(analyse(compared(lugre=30.0, hybrid=3.0), "hybrid", "lugre", curves, 4.0, 50))
    plots = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["plots"]
    assert len(plots) == 2
    for plot in plots:
        (settings,) = plot.values()
        for axis in ("x", "y"):
            ((path, columns),) = settings[axis].items()
            head = tables[path.removeprefix("reports/plots/")].splitlines()[0].split(",")
            assert set([columns] if isinstance(columns, str) else columns) <= set(head)
