"""Work in processes: one that dies costs its own piece only."""

from __future__ import annotations

import multiprocessing
import os
import time
from concurrent.futures.process import BrokenProcessPool
from functools import partial

import pytest

from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.execution.workers import ONE_THREAD, VARIABLE, LostPiece, Processes, WorkersError
from process_work import die, minutes_if_first, slow_if_first, threads


def test_results_come_in_the_order_of_the_pieces_whichever_ends_first() -> None:
    with Processes(2) as workers:
        assert list(workers.in_order([partial(slow_if_first, n) for n in range(5)])) == [*range(5)]


def test_a_process_that_dies_costs_none_of_the_pieces_that_were_handed_out_with_its_own() -> None:
    pieces = [partial(die if n in (9, 10) else slow_if_first, n) for n in range(40)]
    with Processes(2) as workers:
        assert list(workers.in_order(pieces)) == [*range(9), LostPiece(), LostPiece(), *range(11, 40)]


def test_a_process_that_dies_between_two_batches_costs_nothing() -> None:
    pieces = [partial(slow_if_first, n) for n in range(4)]
    with Processes(2) as workers:
        assert list(workers.in_order(pieces)) == [*range(4)]
        with pytest.raises(BrokenProcessPool):
            workers.submit(partial(die, 0)).result()
        assert list(workers.in_order(pieces)) == [*range(4)]


def test_an_exception_of_a_piece_is_raised_here() -> None:
    with Processes(2) as workers, pytest.raises(ZeroDivisionError):
        list(workers.in_order([partial(divmod, 1, n) for n in (1, 0)]))


def test_an_interrupt_ends_what_is_running() -> None:
    started_s, others = time.monotonic(), set(multiprocessing.active_children())  # a reader of logs may be among them

    def interrupted() -> None:
        with Processes(2) as workers:
            next(workers.do_all([partial(minutes_if_first, n) for n in range(2)]))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - started_s < 60.0
    assert set(multiprocessing.active_children()) <= others


def test_every_process_has_one_thread_and_this_one_its_own_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ONE_THREAD[0], "4")
    monkeypatch.delenv(ONE_THREAD[1], raising=False)
    with Processes(2) as workers:
        found = dict(workers.do_all([partial(threads, n) for n in range(4)]))
    assert list(found.values()) == [["1"] * len(ONE_THREAD)] * 4
    assert os.environ[ONE_THREAD[0]] == "4"
    assert ONE_THREAD[1] not in os.environ


@pytest.mark.parametrize("value", ["0", "-1", "two", "2.5", "tcp://host", "http://host:8786", "missing.json"])
def test_a_wrong_value_is_refused(value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, value)
    with pytest.raises(WorkersError) as caught:
        workers_from_environment()
    assert str(caught.value) == (
        f"CYLINDER_FRICTION_WORKERS is '{value}'; expected a number of processes such as 2, the address of a Dask "
        "scheduler such as tcp://host:8786, or the file that `dask scheduler --scheduler-file` wrote; unset, work is "
        "done here"
    )


def test_the_variable_counts_more_than_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert workers_from_environment().here
    default = workers_from_environment(3)
    monkeypatch.setenv(VARIABLE, "2")
    asked = workers_from_environment()
    monkeypatch.setenv(VARIABLE, "1")
    assert workers_from_environment(3).here
    assert [each.count for each in (default, asked) if isinstance(each, Processes)] == [3, 2]
