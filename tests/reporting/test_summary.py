"""Three sentences: they state what the numbers state, whichever estimator wins."""

from __future__ import annotations

from cylinder_friction.evaluation.comparison import compare, points_ahead
from cylinder_friction.evaluation.metric_tree import metric_tree
from cylinder_friction.reporting.comparison_tables import difference_table
from cylinder_friction.reporting.summary import CLEAR_POINTS, leaders, summary, verdict
from made_comparison import SETTINGS, OffsetEstimator


def test_a_hybrid_that_wins_everywhere(compared):
    words = summary(compared(hybrid=1.0, ridge=3.0, lugre=40.0), "hybrid")
    assert len(words) == 3
    assert words[0] == (
        "Against the label, the mean absolute error of the hybrid is 0.33 %, 0.25 %, 0.20 % and 0.17 % of mean "
        "friction in conditions 1, 2, 3 and 4: 1.0 N."
    )
    assert words[1] == "It is clearly better than every other estimator in every condition."


def test_a_difference_within_chance_is_not_clear(compared):
    comparison = compared(hybrid=(0.0, 3.0), ridge=(0.0, -3.0), lugre=40.0)
    assert verdict(comparison.label, "hybrid", "ridge", "1") == "level"
    assert "ridge on lagged samples is level with it." in summary(comparison, "hybrid")[1]


def test_a_difference_too_small_to_matter_is_not_clear_however_certain(compared):
    comparison = compared(hybrid=1.0, lstm=1.0 + 0.9 * CLEAR_POINTS * 6.0, lugre=40.0)
    assert points_ahead(comparison.label, "hybrid", "lstm", "4")[1] > 0.0
    assert verdict(comparison.label, "hybrid", "lstm", "4") == "level"
    assert verdict(comparison.label, "hybrid", "lugre", "4") == "better"
    assert verdict(comparison.label, "lugre", "hybrid", "4") == "worse"
    assert leaders(comparison.label, "4") == ["hybrid", "lstm"]


def test_with_one_session_in_each_condition_nothing_is_clear(strokes):
    estimators = {name: OffsetEstimator(offset).fit(strokes) for name, offset in (("hybrid", 1.0), ("lugre", 40.0))}
    comparison = compare(estimators, strokes[::2], SETTINGS)
    assert summary(comparison, "hybrid")[1] == (
        "With one held-out session in each condition chance is not known and no difference is clear: hold out two "
        "(split.test_sessions)."
    )
    assert leaders(comparison.label, "1") == ["hybrid"], "not a star for everybody"
    assert difference_table(comparison, "hybrid").cells[0][1].small == "not known"
    assert not [name for name in metric_tree(comparison)["hybrid"]["1"] if name.endswith(("_low", "_high"))]


def test_true_friction_comes_first_where_it_is_known(compared, strokes):
    truth = {r.name: r.column("friction_n") + 10.0 for r in strokes}
    words = summary(compared(truth, hybrid=1.0, lugre=10.0), "hybrid")
    assert words[0].startswith("Against true friction, the mean absolute error of the hybrid is")
    assert words[0].endswith("9.0 N.")
    assert "LuGre is clearly better" in words[1]
    assert words[2].startswith("Nearest to true friction is LuGre; the label itself errs by")
    assert "Against that label, which it was trained on, the hybrid errs by" in words[2]


def test_unknown_truth_is_stated(compared):
    assert "True friction is not known" in summary(compared(hybrid=1.0, lugre=10.0), "hybrid")[2]
