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
    for text in tables.values():
        assert len({line.count(",") for line in text.splitlines()}) == 1
    assert tables["learning_curve.csv"].splitlines()[2] == "2,20,25"
    assert tables["friction_over_time.csv"].startswith("time_s,condition,label_n,truth_n,rival_n,estimate_n\n")
    head, *rows = tables["errors_by_condition.csv"].splitlines()
    assert head == "condition,error_percent,mae_n,against"
    assert [row.split(",")[0] for row in rows] == ["1", "2", "3", "4", "mean"], "of the model alone"
    assert {row.split(",")[-1] for row in rows} == {"truth"}
    sessions = tables["errors_by_session.csv"].splitlines()
    assert len(sessions) == 1 + len({recording.metadata.session for recording in strokes})


def test_every_plot_of_dvc_is_drawn_from_a_column_that_is_there(compared, curves):
    tables = plot_tables(analyse(compared(lugre=30.0, hybrid=3.0), "hybrid", "lugre", curves, 4.0, 50))
    plots = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["plots"]
    drawn = set()
    for plot in plots:
        ((_, settings),) = plot.items()
        for path, columns in settings["y"].items():
            head = tables[Path(path).name].splitlines()[0].split(",")
            assert {settings["x"], *([columns] if isinstance(columns, str) else columns)} <= set(head)
            assert Path(path).parent.as_posix() == "reports/plots"
            drawn.add(Path(path).name)
    assert drawn == set(tables)
