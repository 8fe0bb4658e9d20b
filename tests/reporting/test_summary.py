"""The summary in words and the tables: they say what the numbers say, whoever wins."""

from __future__ import annotations

import numpy as np

from cylinder_friction.evaluation.timing import StepTime
from cylinder_friction.reporting.comparison_tables import (
    cost_table,
    data_table,
    error_table,
    hyperparameter_table,
    markdown_tables,
)
from cylinder_friction.reporting.summary import summary, winner


def test_a_hybrid_that_wins_everywhere_is_said_to(compared):
    words = summary(compared(hybrid=1.0, ridge=2.0, lugre=40.0), "hybrid")
    assert words[0].startswith("Against the label, the hybrid errs by 0.33 %, 0.25 %, 0.20 %, 0.17 % in tests 1, 2, 3")
    assert "the smallest error of all estimators in every test" in words[0]
    assert "The hybrid beats ridge on lagged samples in every test, by 0.17 to 0.33 percentage points." in words
    assert any("published error of the paper is 5.57 %" in sentence and "every test" in sentence for sentence in words)


def test_a_ridge_that_wins_is_said_to(compared):
    comparison = compared(hybrid=3.0, ridge=1.0, lugre=40.0)
    words = summary(comparison, "hybrid")
    assert [winner(comparison.label, condition) for condition in comparison.conditions] == ["ridge"] * 4
    assert words[0].endswith("in 0 of 4 tests: ridge on lagged samples is better in tests 1, 2, 3 and 4.")
    assert any(
        s.startswith("condition 1: ridge on lagged samples has the smallest error, 0.33 % (1.0 N)") for s in words
    )
    expected = "The hybrid does not beat ridge on lagged samples in any test: it is behind by 0.33 to 0.67 percentage"
    assert any(sentence.startswith(expected) for sentence in words)
    assert any(sentence.startswith("The hybrid beats LuGre in every test") for sentence in words)


def test_a_low_pass_that_wins_is_said_to(compared):
    words = summary(compared(hybrid=3.0, force_balance_low_pass=-1.0, lugre=40.0), "hybrid")
    assert "the tuned low-pass of the force balance is better in tests 1, 2, 3 and 4" in words[0]


def test_a_difference_within_chance_is_called_so(compared):
    words = summary(compared(hybrid=(0.0, 3.0), ridge=(0.0, -3.0), lugre=40.0), "hybrid")
    ridge = [sentence for sentence in words if "ridge" in sentence]
    assert ridge
    assert any("within chance" in sentence for sentence in ridge)


def test_truth_that_is_not_known_is_said_to_be_so(compared):
    assert "True friction is not known" in summary(compared(hybrid=1.0, lugre=2.0), "hybrid")[-1]


def test_truth_is_judged_in_sentences_of_its_own(compared, strokes):
    truth = {recording.name: recording.column("friction_n") + 10.0 for recording in strokes}
    words = summary(compared(truth, hybrid=1.0, lugre=10.0), "hybrid")
    against_truth = next(sentence for sentence in words if sentence.startswith("Against true friction"))
    assert "LuGre is better in tests 1, 2, 3 and 4" in against_truth
    assert words[-1].startswith("The label itself")


def test_the_error_table_states_its_denominator_and_marks_the_smallest(compared, strokes):
    table = error_table((comparison := compared(hybrid=1.0, lugre=40.0)).label, comparison.conditions, "label", True)
    labels = np.concatenate([r.column("friction_n")[10:] for r in strokes if r.metadata.condition == "1"])
    denominator = np.abs(labels).mean()
    assert table.head[1] == f"condition 1 [% of mean |label| = {denominator:.0f} N]"
    assert table.rows[0][1] == f"{100 / denominator:.2f} % (1.0 N)"
    assert table.rows[1][1] == f"{4000 / denominator:.2f} % (40.0 N)"
    assert table.best == {(0, 1), (0, 2), (0, 3), (0, 4)}
    assert [row[0] for row in table.rows[2:]] == ["Published: LuGre (other data)", "Published: hybrid (other data)"]
    assert table.rows[3][4] == "5.57 %"


def test_markdown_keeps_its_columns_though_heads_hold_bars(compared, strokes):
    truth = {recording.name: recording.column("friction_n") for recording in strokes}
    text = markdown_tables(compared(truth, hybrid=1.0, lugre=40.0))
    assert "against the label" in text
    assert "against true friction" in text
    rows = [line.replace("\\|", "") for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in rows} == {6}
    assert "**0.33 % (1.0 N)**" in text


def test_the_cost_table_shows_counts_times_and_the_published_ones(compared):
    table = cost_table(compared(hybrid=1.0, lugre=2.0, paper_hybrid=3.0), {"lugre": StepTime(10, 2e-6, 5e-6, 9e-6)})
    assert table.rows[1] == ("LuGre (identified in one condition)", "2", "2.0", "5.0", "87")
    assert table.rows[2][2:] == ("not measured", "not measured", "1510")


def test_the_data_table_counts_recordings_minutes_and_rows(compared):
    row = data_table(compared(hybrid=1.0, lugre=2.0)).rows[0]
    assert row[:4] == ("1", "2", "0.3", "3,980 of 4,000")
    assert row[5:] == ("not known", "100.0")


def test_table_one_shows_ranges_choices_and_published_values():
    table = hyperparameter_table({"layers": [1, 2], "learning_rate": (1e-3, 1e-2)}, {"layers": 1, "dropout": 0.1})
    assert table.rows[0] == ("LSTM layers", "1, 2", "1", "3, 4, 5", "4")
    assert table.rows[3][1:3] == ("0.001 to 0.01", "not recorded")
    assert table.rows[2][1:3] == ("not searched", "0.1")
