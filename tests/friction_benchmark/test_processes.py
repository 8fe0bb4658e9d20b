"""Work in processes: one that dies costs its own piece only."""

from __future__ import annotations

import multiprocessing
import os
import time
from functools import partial

import pytest

from friction_benchmark.processes import ONE_THREAD, Died, Workers
from process_work import die, minutes_if_first, slow_if_first, threads, twice


def test_one_worker_does_all_in_order() -> None:
    assert list(Workers(1).do_all([partial(twice, n) for n in range(3)])) == [(0, 0), (1, 2), (2, 4)]


@pytest.mark.slow
def test_two_workers_do_the_same() -> None:
    with Workers(2) as workers:
        for _ in range(2):
            assert sorted(workers.do_all([partial(twice, n) for n in range(5)])) == [(n, 2 * n) for n in range(5)]


@pytest.mark.slow
def test_a_process_that_dies_costs_its_own_piece() -> None:
    pieces = [partial(die if n == 1 else slow_if_first, n) for n in range(4)]
    with Workers(2) as workers:
        done = dict(workers.do_all(pieces))
    assert done.pop(1) == Died()
    assert done == {0: 0, 2: 2, 3: 3}


@pytest.mark.slow
def test_an_interrupt_ends_what_is_running() -> None:
    started_s = time.monotonic()

    def interrupted() -> None:
        with Workers(2) as workers:
            next(workers.do_all([partial(minutes_if_first, n) for n in range(2)]))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - started_s < 60.0
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_every_process_has_one_thread_and_this_one_its_own_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ONE_THREAD[0], "4")
    monkeypatch.delenv(ONE_THREAD[1], raising=False)
    with Workers(2) as workers:
        found = dict(workers.do_all([partial(threads, n) for n in range(4)]))
    assert list(found.values()) == [["1"] * len(ONE_THREAD)] * 4
    assert os.environ[ONE_THREAD[0]] == "4"
    assert ONE_THREAD[1] not in os.environ
