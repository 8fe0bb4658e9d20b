"""Who comes to the finals of a search: the best trial of each size of network."""

import pytest

from cylinder_friction.tuning.finals import Final, best_final, finalists
from cylinder_friction.tuning.search import Trial


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
