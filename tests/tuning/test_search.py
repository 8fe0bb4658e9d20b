"""The search keeps what is finished, repeats nothing, stays under its bound, finds the best, and ends in finals."""

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from optuna.storages.journal import JournalFileSymlinkLock

from cylinder_friction.tuning.finals import Final, best_final, finalists
from cylinder_friction.tuning.search import Objective, SearchPlan, Trial, run_search
from cylinder_friction.tuning.space import SearchSpace
from process_work import cost
from search_work import KilledError, bowl, killed_at

SPACE = SearchSpace((1, 2, 3), (16, 32, 64), (0.1, 0.3), (1e-5, 1e-3), (32, 100), (10, 50))
PLAN = SearchPlan(trials=14, startup_trials=4, maximum_multiply_adds=190, seed=3)


@pytest.fixture
def search(tmp_path: Path) -> Callable[..., list[Trial]]:
    def run(journal: str, objective: Objective = bowl, **changes: Any) -> list[Trial]:
        return run_search(SPACE, replace(PLAN, **changes), cost, objective, tmp_path / journal)

    return run


@pytest.mark.parametrize(("batch", "kills"), [(1, (2, 5, 6)), (3, (1,)), (3, (2,)), (3, (3,)), (3, (4,)), (3, (7,))])
def test_a_search_killed_again_and_again_equals_an_undisturbed_one(
    search: Callable[..., list[Trial]], batch: int, kills: tuple[int, ...]
) -> None:
    undisturbed = search("whole.log", batch=batch)
    tried, objective = killed_at(*kills)
    for _ in kills:
        with pytest.raises(KilledError):
            search("killed.log", objective, batch=batch)
    assert search("killed.log", objective, batch=batch) == undisturbed
    repeated = len(tried) - sum(trial.state != "too_costly" for trial in undisturbed)
    assert len(kills) <= repeated <= batch * len(kills), "only what was not finished is tried again"
    if batch > 1:
        assert undisturbed != search("one.log")


def test_a_kill_while_the_journal_is_written_keeps_nobody_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    JournalFileSymlinkLock("trials.log").acquire()  # as Optuna does; the kill comes before it lets go
    search = threading.Thread(target=run_search, args=(SPACE, PLAN, cost, bowl, Path("trials.log")), daemon=True)
    search.start()
    search.join(timeout=60.0)
    assert not search.is_alive()


def test_it_finds_the_best_prunes_what_is_worse_than_most_and_never_trains_what_is_too_costly(
    search: Callable[..., list[Trial]],
) -> None:
    tried, objective = killed_at()
    trials = search("trials.log", objective, trials=20)
    best = min((each for each in trials if each.value is not None), key=lambda each: each.value or 0.0)
    assert (best.params["layers"], best.params["nodes"]) == (1, 64)
    pruned = [trial for trial in trials if trial.state == "pruned"]
    assert pruned
    assert all(trial.value is None and 1 < len(trial.reported) <= 3 for trial in pruned)
    costly = [trial for trial in trials if trial.state == "too_costly"]
    assert costly
    assert all(trial.multiply_adds > PLAN.maximum_multiply_adds and not trial.reported for trial in costly)
    assert [trial.params for trial in trials if trial.state != "too_costly"] == tried
    assert max(map(cost, tried)) <= PLAN.maximum_multiply_adds
    started_s, ended_s, *reported_s = best.when_s
    assert len(reported_s) == len(best.reported) == 3
    assert started_s <= reported_s[0] <= reported_s[-1] <= ended_s


def test_trials_survive_the_disk_and_a_line_cut_off(search: Callable[..., list[Trial]], tmp_path: Path) -> None:
    trials = search("deep/trials.log")
    with (tmp_path / "deep/trials.log").open("ab") as file:
        file.write(b'{"op_code":5,"wor')
    assert search("deep/trials.log") == trials
    assert search("deep/trials.log", trials=PLAN.trials + 1)[:-1] == trials


def trial(nodes: int, value: float | None, dropout: float = 0.0) -> Trial:
    state = "complete" if value is not None else "pruned"
    return Trial({"layers": 1, "nodes": nodes, "dropout": dropout}, state, value, 10 * nodes)


def test_the_best_of_each_size_of_network_come_to_the_finals() -> None:
    trials = [trial(16, 5.2), trial(16, 5.1, 0.1), trial(48, 5.3), trial(32, None), trial(24, 5.4), trial(48, 5.9)]
    assert finalists(trials, 2) == [trials[1], trials[2]]
    assert finalists(trials, 9) == [trials[1], trials[2], trials[4]], "a pruned trial has no error"


def test_the_final_with_the_smallest_mean_error_decides() -> None:
    finals = [Final({"nodes": 16}, (5.0, 6.0), 160), Final({"nodes": 48}, (5.2, 5.3), 480), Final({}, (9.0, 9.0), 0)]
    assert best_final(finals) is finals[1]


def test_nothing_completed_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(ValueError, match=r"none of 1 trials was completed \(states \['too_costly'\]\); raise maximum"):
        finalists([Trial({"layers": 1}, "too_costly", None, 10)], 3)
