"""Independent pieces of work, done by whoever is there; a worker that is lost costs its own piece of work, no other."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from multiprocessing.process import BaseProcess

VARIABLE = "CYLINDER_FRICTION_WORKERS"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
LOOK_AFTER_S = 30.0
"""How often workers are looked after while nothing finishes."""

LARGEST_BATCH, MOST_STARTS = 8, 3

Work = Callable[[], Any]
"""Whatever can be pickled and called, such as a ``functools.partial`` of a module's function."""


class WorkersError(RuntimeError):
    """Work could not be done: no such workers, workers unlike each other, or pieces that no worker survived."""


@dataclass(frozen=True)
class Died:
    """A piece of work whose worker died twice: once beside others and once alone."""

    reason: str = "the process that did it died; it may have run out of memory"


class Workers:
    """Does all work in this process, piece after piece; the other kinds of workers derive from it.

    Attributes:
        here: Whether pieces run in this process, so that they may return what is large.
    """

    here = True

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        pass

    def stay_here(self, _pieces: int) -> bool:
        """Return whether this many pieces run in this process, so that they may return what is large."""
        return True

    def do_all(self, pieces: Sequence[Work]) -> Iterator[tuple[int, Any]]:
        """Yield the number of each piece and what it returned, or ``Died``, as they finish.

        Pieces are independent of each other; an exception in one is raised here, so each should catch its own.
        """
        yield from enumerate(self.in_order(pieces))

    def in_order(self, pieces: Iterable[Work]) -> Iterator[Any]:
        """Yield what each piece returned, or ``Died``, in the order of the pieces; here, as they are asked for."""
        for piece in pieces:
            yield piece()

    def all_in_order(self, pieces: Sequence[Work], names: Sequence[str]) -> Iterator[Any]:
        """Yield what each piece returned, in the order of the pieces.

        Raises:
            WorkersError: In the end, with the names of the pieces that no worker survived.
        """
        lost: dict[str, str] = {}
        for name, result in zip(names, self.in_order(pieces), strict=True):
            if isinstance(result, Died):
                lost[name] = result.reason
            else:
                yield result
        if lost:
            done = f"; the other {len(names) - len(lost)} of {len(names)} are done" if len(lost) < len(names) else ""
            raise WorkersError("; ".join(f"{name}: {reason}" for name, reason in lost.items()) + done)


class ExecutorWorkers(Workers):
    """Work given to a ``concurrent.futures.Executor``.

    Attributes:
        at_once: Number of batches of pieces that run side by side.
        least: Fewer pieces than this are done in this process, for workers take longer to begin.
        lost: Raised for a piece whose worker died.
    """

    here = False
    at_once: int
    least = 0
    lost: tuple[type[Exception], ...]

    def executor(self) -> Executor:
        """Return what does the work, started if need be."""
        raise NotImplementedError

    def died(self, error: Exception, executor: Executor) -> Died:
        """Return why a piece is lost, and make sure that the next one finds workers; ``executor`` had the piece."""
        raise NotImplementedError

    def prepared(self, piece: Work) -> Work:
        """Return a piece with what its worker needs beside it."""
        return piece

    def batch_size(self, _pieces: int) -> int:
        """Return how many pieces a worker is given at a time, where there are ``_pieces`` in all."""
        return 1

    def stay_here(self, pieces: int) -> bool:
        return pieces < self.least

    def look_after(self) -> None:
        """Make sure that there are workers; called now and then while nothing finishes."""

    def do_all(self, pieces: Sequence[Work]) -> Iterator[tuple[int, Any]]:
        suspects: list[tuple[int, Work]] = []
        for number, result in self._round(list(enumerate(pieces))):
            if isinstance(result, Died):  # it, or what ran beside it
                suspects.append((number, pieces[number]))
            else:
                yield number, result
        for suspect in sorted(suspects, key=lambda each: each[0]):
            yield from self._round([suspect])

    def in_order(self, pieces: Iterable[Work]) -> Iterator[Any]:
        pieces = list(pieces)
        if self.stay_here(len(pieces)):
            yield from super().in_order(pieces)
            return
        finished: dict[int, Any] = {}
        following = 0
        for number, result in self.do_all(pieces):
            finished[number] = result
            while following in finished:
                yield finished.pop(following)
                following += 1

    def _round(self, waiting: list[tuple[int, Work]]) -> Iterator[tuple[int, Any]]:
        running: dict[Future[Any], tuple[list[int], Executor]] = {}
        waiting.reverse()
        size = self.batch_size(len(waiting))
        while waiting or running:
            # No more at a time than there are processes: if one dies, few are under suspicion.
            while waiting and len(running) < self.at_once:
                given = [waiting.pop() for _ in range(min(size, len(waiting)))]
                future, executor = self._handed_out([piece for _, piece in given])
                running[future] = [number for number, _ in given], executor
            finished, _ = wait(running, timeout=LOOK_AFTER_S, return_when=FIRST_COMPLETED)
            if not finished:
                self.look_after()
            for future in finished:
                numbers, executor = running.pop(future)
                try:
                    results = future.result()
                except self.lost as error:
                    results = [self.died(error, executor)] * len(numbers)
                yield from zip(numbers, results, strict=True)

    def _handed_out(self, pieces: Sequence[Work]) -> tuple[Future[Any], Executor]:
        for _ in range(MOST_STARTS):
            executor = self.executor()
            try:
                return executor.submit(_done, [self.prepared(piece) for piece in pieces]), executor
            except self.lost as error:  # a worker that died while nothing was asked of it
                self.died(error, executor)
        raise WorkersError(f"workers died {MOST_STARTS} times before they had begun; the machine may be out of memory")


def _done(pieces: Sequence[Work]) -> list[Any]:
    return [piece() for piece in pieces]


class Processes(ExecutorWorkers):
    """Processes of this machine that stay for one batch of work after another."""

    lost = (BrokenProcessPool,)

    def __init__(self, count: int, least: int = 0) -> None:
        self.at_once, self.least = count, least
        self._processes: ProcessPoolExecutor | None = None
        self._children: list[BaseProcess] = []

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:  # Ctrl-C among them: what is running would go on for minutes
            for process in self._children:
                process.terminate()
        self._stop()

    def executor(self) -> Executor:
        """Return processes that inherit nothing but the environment, in which every library has one thread."""
        if self._processes is None:
            others = multiprocessing.active_children()
            with _one_thread():
                self._processes = ProcessPoolExecutor(
                    self.at_once,
                    mp_context=multiprocessing.get_context("spawn"),
                    initializer=signal.signal,  # Ctrl-C reaches every process; this one ends the others
                    initargs=(signal.SIGINT, signal.SIG_IGN),
                )
                # They begin as they are asked; all of them must while the environment is as it should be.
                wait([self._processes.submit(os.getpid) for _ in range(self.at_once)])
            self._children = [child for child in multiprocessing.active_children() if child not in others]
        return self._processes

    def batch_size(self, pieces: int) -> int:
        """Return more than 1 only for many pieces: they are small, and a worker would wait for each next one."""
        return max(1, min(LARGEST_BATCH, pieces // (LARGEST_BATCH * self.at_once)))

    def died(self, _error: Exception, executor: Executor) -> Died:
        if executor is self._processes:  # and not yet replaced: all of its pieces are lost, one after the other
            self._stop()
        return Died()

    def _stop(self) -> None:
        if self._processes is not None:
            self._processes.shutdown(cancel_futures=True)
            self._processes, self._children = None, []


@contextmanager
def _one_thread() -> Iterator[None]:
    """Have every library take one thread, and no worker workers of its own."""
    names = (*ONE_THREAD, VARIABLE)
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
