"""The search keeps what is finished, repeats nothing, stays under its bound, and finds the best."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from optuna.storages.journal import JournalFileSymlinkLock

from cylinder_friction.tuning.search import SearchPlan, Trial, best_trial, run_search
from cylinder_friction.tuning.space import SearchSpace
from cylinder_friction.tuning.trials import DiscardedTrial

if TYPE_CHECKING:
    from cylinder_friction.tuning.search import Value
    from cylinder_friction.tuning.trials import Report

SPACE = SearchSpace((1, 2, 3), (16, 32, 64), (0.1, 0.3), (1e-5, 1e-3), (32, 100), (10, 50))
PLAN = SearchPlan(trials=14, startup_trials=4, maximum_multiply_adds=200, seed=3)


class KilledError(Exception):
    """Stands for the kill signal."""


def cost(params: dict[str, Value]) -> int:
    return int(params["layers"] * params["nodes"])


def bowl(params: dict[str, Value], report: Report) -> float:
    """Best at one layer of 64 nodes; reports its error falling over three epochs."""
    error = 10.0 + 5.0 * (params["layers"] - 1) + abs(params["nodes"] - 64) / 8 + params["dropout"]
    for epoch in range(3):
        report(error * (2.0 - 0.3 * epoch))
    return float(error)


def test_a_search_killed_again_and_again_equals_an_undisturbed_one(tmp_path: Path) -> None:
    undisturbed = run_search(SPACE, PLAN, cost, bowl, tmp_path / "whole.log", lambda _: None)
    calls: list[dict[str, Value]] = []

    def sometimes_killed(params: dict[str, Value], report: Report) -> float:
        calls.append(params)
        if len(calls) in (2, 5, 6):
            raise KilledError
        return bowl(params, report)

    for _ in range(3):
        with pytest.raises(KilledError):
            run_search(SPACE, PLAN, cost, sometimes_killed, tmp_path / "killed.log", lambda _: None)
    resumed = run_search(SPACE, PLAN, cost, sometimes_killed, tmp_path / "killed.log", lambda _: None)
    assert resumed == undisturbed
    run = sum(trial.state != "too_costly" for trial in undisturbed)
    assert len(calls) == run + 3


@pytest.mark.parametrize("killed_at", [1, 2, 3, 4, 7])
def test_a_search_in_batches_killed_within_one_equals_an_undisturbed_one(tmp_path: Path, killed_at: int) -> None:
    plan = replace(PLAN, batch=3)
    undisturbed = run_search(SPACE, plan, cost, bowl, tmp_path / "whole.log", lambda _: None)
    calls = iter(range(1, 1000))

    def killed(params: dict[str, Value], report: Report) -> float:
        if next(calls) == killed_at:
            raise KilledError
        return bowl(params, report)

    with pytest.raises(KilledError):
        run_search(SPACE, plan, cost, killed, tmp_path / "killed.log", lambda _: None)
    assert run_search(SPACE, plan, cost, killed, tmp_path / "killed.log", lambda _: None) == undisturbed
    assert undisturbed != run_search(SPACE, PLAN, cost, bowl, tmp_path / "one.log", lambda _: None)


def test_a_kill_while_the_journal_is_written_keeps_nobody_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    JournalFileSymlinkLock("trials.log").acquire()  # as Optuna does; the kill comes before it lets go
    arguments = (SPACE, PLAN, cost, bowl, Path("trials.log"), lambda _: None)
    search = threading.Thread(target=run_search, args=arguments, daemon=True)
    search.start()
    search.join(timeout=60.0)
    assert not search.is_alive()


def test_it_finds_the_best_and_prunes_what_is_worse_than_most(tmp_path: Path) -> None:
    trials = run_search(SPACE, PLAN, cost, bowl, tmp_path / "trials.log", lambda _: None)
    best = best_trial(trials)
    assert best.params["layers"] == 1
    assert best.params["nodes"] == 64
    pruned = [trial for trial in trials if trial.state == "pruned"]
    assert pruned
    assert all(trial.value is None and 1 < len(trial.reported) <= 3 for trial in pruned)


def test_what_is_too_costly_is_never_trained(tmp_path: Path) -> None:
    plan = SearchPlan(trials=12, startup_trials=12, maximum_multiply_adds=64, seed=0)

    def refuse_costly(params: dict[str, Value], report: Report) -> float:
        assert cost(params) <= 64
        return bowl(params, report)

    trials = run_search(SPACE, plan, cost, refuse_costly, tmp_path / "trials.log", lambda _: None)
    assert {trial.state for trial in trials} >= {"too_costly", "complete"}


def test_trials_survive_the_disk_and_a_line_cut_off(tmp_path: Path) -> None:
    journal = tmp_path / "deep/trials.log"
    trials = run_search(SPACE, PLAN, cost, bowl, journal, lambda _: None)
    with journal.open("ab") as file:
        file.write(b'{"op_code":5,"wor')
    again = run_search(SPACE, PLAN, cost, bowl, journal, lambda _: None)
    assert again == trials
    longer = replace(PLAN, trials=PLAN.trials + 1)
    assert run_search(SPACE, longer, cost, bowl, journal, lambda _: None)[:-1] == trials


def test_nothing_completed_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(ValueError, match=r"none of 1 trials was completed \(states \['too_costly'\]\); raise maximum"):
        best_trial([Trial({"layers": 1}, "too_costly", None, 10)])


def test_what_the_report_raises_ends_the_trial(tmp_path: Path) -> None:
    plan = SearchPlan(trials=8, startup_trials=2, maximum_multiply_adds=10**9, seed=0)
    worse = iter(range(100))

    def worsening(params: dict[str, Value], report: Report) -> float:
        level = float(next(worse))
        try:
            report(level)
            report(level)
        except DiscardedTrial:
            raise
        return level

    trials = run_search(SPACE, plan, cost, worsening, tmp_path / "trials.log", lambda _: None)
    assert [trial.state for trial in trials].count("pruned") >= 4
