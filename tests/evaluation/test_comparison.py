"""The comparison: figures by hand, label and truth kept apart, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.evaluation.analysis import analyse
from cylinder_friction.evaluation.comparison import LABEL_ITSELF, compare, mean_percent, points_ahead
from cylinder_friction.evaluation.metric_tree import metric_tree
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.smooth_signals import filtered


def test_scores_by_hand(compared, strokes):
    comparison = compared(hybrid=3.0, lugre=-30.0)
    assert comparison.conditions == ("1", "2", "3", "4")
    for condition in comparison.conditions:
        labels = np.concatenate([r.column("friction_n")[10:] for r in strokes if r.metadata.condition == condition])
        score = comparison.label["hybrid"][condition]
        assert score.errors.mae_n == pytest.approx(3.0)
        assert score.errors.mean_abs_friction_n == pytest.approx(np.abs(labels).mean())
        assert score.errors.percent == pytest.approx(300.0 / np.abs(labels).mean())
        assert score.errors.rows == 2 * 1990
        percent, low, high = mean_percent(comparison.label["hybrid"], [condition])
        assert low <= percent <= high
        assert percent == score.errors.percent
        assert list(score.sessions.percent) == [f"s-t{condition}_1", f"s-t{condition}_2"]
        assert score.lag_s == pytest.approx(0.0, abs=1e-3)
        assert comparison.label["lugre"][condition].errors.bias_n == pytest.approx(-30.0)
    assert comparison.multiply_adds == {"hybrid": 2, "lugre": 2}
    assert comparison.truth == {}


def test_the_mean_of_the_conditions_and_a_difference_have_the_sessions_intervals(compared, strokes):
    truth = {each.name: each.column("friction_n") + 5.0 * each.name.endswith("2") for each in strokes}
    scores = compared(truth, hybrid=2.0, lugre=9.0).truth
    percent, low, high = mean_percent(scores["hybrid"], ["1", "2", "3", "4"])
    assert percent == pytest.approx(np.mean([scores["hybrid"][each].errors.percent for each in "1234"]))
    assert low < percent < high
    ahead, low, high = points_ahead(scores, "hybrid", "lugre", "1")
    assert ahead == pytest.approx(scores["lugre"]["1"].errors.percent - scores["hybrid"]["1"].errors.percent)
    assert low < ahead < high


def test_truth_has_its_own_scores_and_its_own_denominator(compared, strokes):
    truth = {r.name: r.column("friction_n") + 5.0 for r in strokes if r.metadata.condition != "4"}
    comparison = compared(truth, hybrid=3.0, lugre=5.0)
    assert comparison.label["hybrid"]["1"].errors.mae_n == pytest.approx(3.0)
    assert comparison.truth["hybrid"]["1"].errors.mae_n == pytest.approx(2.0)
    assert comparison.truth["lugre"]["1"].errors.mae_n == pytest.approx(0.0, abs=1e-9)
    assert comparison.truth[LABEL_ITSELF]["1"].errors.mae_n == pytest.approx(5.0)
    denominator = np.mean([np.abs(truth[r.name][10:]).mean() for r in strokes if r.metadata.condition == "1"])
    assert comparison.truth["hybrid"]["1"].errors.mean_abs_friction_n == pytest.approx(denominator)
    assert "4" not in comparison.truth["hybrid"]
    tree = metric_tree(comparison)
    assert tree["hybrid"]["1"]["label_mae_n"] == pytest.approx(3.0)
    assert tree["hybrid"]["1"]["truth_mae_n"] == pytest.approx(2.0)
    assert not [name for name in tree["hybrid"]["4"] if name.startswith("truth_")]


def test_residuals_are_label_minus_estimate_with_gaps_between_recordings(compared):
    residual, usable = compared(hybrid=3.0, lugre=1.0).residuals("hybrid")
    assert len(residual) == 8 * 2001
    assert not usable[2000::2001].any()
    assert residual[usable] == pytest.approx(-3.0)


def test_what_cannot_be_compared_is_refused(compared, strokes, curves):
    with pytest.raises(RecordingError, match="got 0 estimators and 8 held-out recordings"):
        compare({}, strokes)
    with pytest.raises(RecordingError, match=r"'t1_1': true friction has shape \(5,\), expected \(2000,\)"):
        compared({strokes[0].name: np.zeros(5)}, hybrid=1.0, lugre=1.0)
    with pytest.raises(RecordingError, match="condition 1, hybrid against the label: estimate is nan at row 10"):
        compared(hybrid=float("nan"), lugre=1.0)
    with pytest.raises(KeyError, match="'hybrid' was not compared"):
        analyse(compared(ridge=1.0, lugre=2.0), "hybrid", "lugre", curves, 2.0, 20)


def test_it_prints_as_a_table_with_the_denominator_in_the_head(compared, strokes):
    truth = {recording.name: recording.column("friction_n") + 5.0 for recording in strokes}
    comparison = compared(truth, hybrid=3.0, **{"<LuGre>": -30.0})
    words = repr(comparison)
    assert words.startswith("Mean absolute error against the label:\n")
    assert "condition 1 [% of mean |label| = 300 N]" in words
    assert "condition 4 [% of mean |truth| = " in words
    assert "1.00 % (3.0 N)" in words
    html = comparison._repr_html_()
    assert html.count("<table") == 2
    assert "&lt;LuGre&gt;" in html
    assert "true friction" not in repr(compared(hybrid=3.0))


@pytest.mark.parametrize(("window", "equal"), [(10, ["force_balance_paper"]), (9, [])])
def test_the_papers_force_balance_equals_the_label_of_the_papers_filter(cylinder, labelled_recordings, window, equal):
    raw = [
        each.without_columns("velocity_m_s", "acceleration_m_s2", "friction_n", "usable")
        for each in labelled_recordings[:4]
    ]
    smooth = MovingAverage(window)
    labelled = [Labeller(cylinder).labelled(filtered(each, smooth), smooth) for each in raw]
    estimators = baselines(cylinder)
    comparison = compare({name: each.fit(labelled) for name, each in estimators.items()}, labelled)
    assert comparison.equal_to_label == equal
