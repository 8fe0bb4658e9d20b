"""Identified zeros never make friction worse: short campaigns with known truth, as in ``performance/zero_sweep.py``."""

import pandas as pd
import pytest
from zero_sweep import sweep

pytestmark = [pytest.mark.extended, pytest.mark.filterwarnings("ignore::UserWarning")]


@pytest.fixture(scope="module")
def calls() -> pd.DataFrame:
    return sweep(["wide zeros", "stated too large", "stated too small"], range(1))


def test_no_call_is_worse_than_one_that_identifies_nothing(calls: pd.DataFrame) -> None:
    assert calls["ratio"].max() <= 1.05
    few = calls[calls["call"].isin(["two sessions", "one session"])]
    assert set(few["ratio"]) == {1.0}, "what a call does not determine is left alone"


def test_sessions_of_one_condition_show_by_how_much_each_deviates(calls: pd.DataFrame) -> None:
    alone = calls[calls["call"].eq("one condition") & calls["kind"].eq("wide zeros")]
    assert alone["ratio"].median() < 0.85
    assert alone["offset held %"].mean() >= 85.0


def test_many_sessions_make_it_better_and_stated_intervals_hold_the_truth(calls: pd.DataFrame) -> None:
    enough = calls[calls["kind"].eq("wide zeros") & calls["call"].isin(["all sessions", "twelve sessions"])]
    assert enough["ratio"].max() < 0.8
    assert enough["offset held %"].mean() >= 85.0
    stated = calls[calls["kind"] != "stated too small"]
    assert stated["label held %"].mean() >= 90.0
