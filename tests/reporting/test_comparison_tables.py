"""Tables: denominators in the head, the best marked, Markdown that keeps its columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cylinder_friction.evaluation.comparison import compare
from cylinder_friction.reporting.comparison_tables import (
    difference_table,
    error_table,
    hyperparameter_table,
    markdown_tables,
)
from made_comparison import SETTINGS, OffsetEstimator


def test_the_error_table_states_its_denominator_and_marks_the_smallest(compared, strokes):
    table = error_table(
        (comparison := compared(hybrid=1.0, lugre=40.0)).label, comparison.conditions, "label", {}, True
    )
    labels = np.concatenate([r.column("friction_n")[10:] for r in strokes if r.metadata.condition == "1"])
    denominator = np.abs(labels).mean()
    head = table.head_cells[1]
    assert (head.words, head.small) == ("Condition 1", f"[% of mean |label| = {denominator:.0f} N]")
    assert table.cells[0][1].words == f"{100 / denominator:.2f} % (1.0 N)"
    assert table.cells[1][1].words == f"{4000 / denominator:.2f} % (40.0 N)"
    best = {(row, column) for row, cells in enumerate(table.cells) for column, each in enumerate(cells) if each.style}
    assert best == {(0, 1), (0, 2), (0, 3), (0, 4)}
    published = [row[0].words for row in table.cells[2:]]
    assert published == ["Published: LuGre (other data)", "Published: hybrid (other data)"]
    assert table.cells[3][4].words == "5.57 %"


def test_markdown_keeps_its_columns_though_heads_hold_bars(compared, strokes):
    truth = {recording.name: recording.column("friction_n") for recording in strokes}
    text = markdown_tables(compared(truth, hybrid=1.0, lugre=40.0))
    assert text.startswith("8 held-out sessions. Bold: ")
    assert "against the label" in text
    assert "against true friction" in text
    rows = [line.replace("\\|", "") for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in rows} == {6}
    assert "**0.33 % (1.0 N)**" in text
    assert text.endswith("|\n")
    published = markdown_tables(compared(hybrid=1.0, lugre=40.0), published=True)
    assert published.endswith("| Published: hybrid (other data) | 5.76 % | 6.35 % | 8.84 % | 5.57 % |\n")
    assert "Published" not in text


def test_of_one_session_the_smallest_alone_is_marked_and_the_table_says_that_it_shows_little(strokes):
    estimators = {name: OffsetEstimator(offset).fit(strokes) for name, offset in (("hybrid", 1.0), ("lugre", 1.1))}
    text = markdown_tables(compare(estimators, strokes[:1], SETTINGS, None))
    assert text.startswith(
        "1 held-out session. Bold: the smallest error of a condition. No condition has two held-out sessions, so that "
        "nothing shows whether it is clearly the smallest."
    )
    assert [line.startswith("| Hybrid") for line in text.splitlines() if "**" in line] == [True]


def test_what_equals_the_label_says_so_in_both_tables_and_is_never_marked(compared, strokes):
    truth = {recording.name: recording.column("friction_n") + 5.0 for recording in strokes}
    comparison = replace(
        compared(truth, force_balance_paper=0.0, hybrid=1.0, lugre=40.0),
        notes={"lugre": "identified in condition 1", "label": "off line, looks ahead"},
    )
    against_truth, against_label = markdown_tables(comparison).split("which estimators learn from")
    row = "| Force balance, moving averages (equals the label by construction) | "
    assert row + "0.00 % (0.0 N) |" in against_label
    assert "**0.33 % (1.0 N)**" in against_label
    assert row in against_truth
    assert against_label.endswith(
        "\nThe label is, sample by sample, what the force balance with the paper's moving averages gives. Whatever can "
        "learn that filter has next to no error against the label; this states nothing about friction.\n"
    )
    assert "| LuGre (identified in condition 1) |" in against_truth
    assert "| Label itself (off line, looks ahead) |" in against_truth
    without = compared(force_balance_paper=0.0, hybrid=1.0, lugre=40.0)
    assert [row[0].words for row in difference_table(without, "hybrid").cells] == ["LuGre"]


def test_table_one_shows_ranges_choices_and_published_values():
    searched, found = {"layers": [1, 2], "learning_rate": [1e-3, 1e-2]}, {"layers": 1, "learning_rate": 5e-3}
    table = hyperparameter_table(searched, found, {"layers": 4, "dropout": 0.1})
    assert table.head[1:] == ("Range searched", "Value found", "Value used", "Published range", "Published value")
    assert table.rows[0] == ("LSTM layers", "1, 2", "1", "4", "3, 4, 5", "4")
    assert table.rows[3][1:4] == ("0.001 to 0.01", "0.005", "not recorded")
    assert table.rows[2][1:4] == ("not searched", "not recorded", "0.1")


def test_the_difference_table_colours_what_is_clear(compared):
    table = difference_table(compared(hybrid=3.0, ridge=1.0, lugre=40.0, lstm=(3.0, 0.1)), "hybrid")
    assert [row[0].words for row in table.cells] == ["Ridge on lagged samples", "LuGre", "LSTM alone"]
    assert [row[1].style for row in table.cells] == ["bad", "good", ""]
    assert table.cells[0][1].words.startswith("-0.6")
