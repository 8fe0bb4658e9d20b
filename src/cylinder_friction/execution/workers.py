"""Independent pieces of work for this process or others; a lost worker costs its own piece of work and no other."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from cylinder_friction.refusal import RefusalError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from multiprocessing.process import BaseProcess

VARIABLE = "CYLINDER_FRICTION_WORKERS"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Work = Callable[[], Any]
"""A piece of work: callable and picklable, such as a ``functools.partial`` of a module's function."""


class WorkersError(RefusalError, RuntimeError):
    """Work could not be done: no such workers, workers unlike each other, or pieces that no worker survived."""


@dataclass(frozen=True)
class LostPiece:
    """Result of a piece whose worker died twice: once beside others and once alone."""

    reason: str = "the process that did it died; it may have run out of memory"


class Workers:
    """Does all work in this process, piece by piece; base of the other kinds of workers.

    Attributes:
        here: Whether pieces run in this process, so that they may return large results.
    """

    here = True

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        pass

    def do_all(self, pieces: Sequence[Work]) -> Iterator[tuple[int, Any]]:
        """Yield the number and the result of each piece, or ``LostPiece``, as they finish.

        Pieces are independent of each other. An exception in a piece is raised here, so a piece should catch its own.
        """
        yield from enumerate(self.in_order(pieces))

    def in_order(self, pieces: Iterable[Work]) -> Iterator[Any]:
        """Yield the result of each piece, or ``LostPiece``, in order; without workers each runs when asked for."""
        for piece in pieces:
            yield piece()

    def all_in_order(self, pieces: Sequence[Work], names: Sequence[str]) -> Iterator[Any]:
        """Yield the result of each piece, in order.

        Raises:
            WorkersError: At the end, with the names of the pieces that no worker survived.
        """
        lost: dict[str, str] = {}
        for name, result in zip(names, self.in_order(pieces), strict=True):
            if isinstance(result, LostPiece):
                lost[name] = result.reason
            else:
                yield result
        if lost:
            done = f"; the other {len(names) - len(lost)} of {len(names)} are done" if len(lost) < len(names) else ""
            raise WorkersError("; ".join(f"{name}: {reason}" for name, reason in lost.items()) + done)


class ExecutorWorkers(Workers):
    """Gives work to a ``concurrent.futures.Executor``; repeats a piece alone if a worker died of it or beside it.

    Attributes:
        at_once: Number of pieces handed out at a time.
        least: Fewer pieces than this are done in this process, as workers take longer to start.
    """

    here = False
    at_once: int
    least = 0

    def submit(self, piece: Work) -> Future[Any]:
        """Hand out a piece."""
        raise NotImplementedError

    def explain_loss(self, error: Exception) -> LostPiece | None:
        """Explain the death of a piece's worker; return None for an exception that the piece itself raised."""
        raise NotImplementedError

    def do_all(self, pieces: Sequence[Work]) -> Iterator[tuple[int, Any]]:
        suspects = []
        for number, result in self._round(range(len(pieces)), pieces):
            if isinstance(result, LostPiece):  # because of it, or of a piece handed out beside it
                suspects.append(number)
            else:
                yield number, result
        for suspect in sorted(suspects):
            yield from self._round([suspect], pieces)

    def in_order(self, pieces: Iterable[Work]) -> Iterator[Any]:
        pieces = list(pieces)
        if len(pieces) < self.least:
            yield from super().in_order(pieces)
            return
        finished: dict[int, Any] = {}
        following = 0
        for number, result in self.do_all(pieces):
            finished[number] = result
            while following in finished:
                yield finished.pop(following)
                following += 1

    def _round(self, numbers: Sequence[int], pieces: Sequence[Work]) -> Iterator[tuple[int, Any]]:
        running: dict[Future[Any], int] = {}
        finished: SimpleQueue[Future[Any]] = SimpleQueue()
        waiting = iter(numbers)
        while True:
            while len(running) < self.at_once and (number := next(waiting, None)) is not None:
                future = self.submit(pieces[number])
                running[future] = number
                future.add_done_callback(finished.put)
            if not running:
                return
            future = finished.get()
            try:
                result = future.result()
            except Exception as error:
                result = self.explain_loss(error)
                if result is None:
                    raise
            yield running.pop(future), result


class Processes(ExecutorWorkers):
    """Processes of this machine, which are kept from one batch of work to the next."""

    def __init__(self, count: int, least: int = 0) -> None:
        self.count, self.least = count, least
        self.at_once = 2 * count  # no process waits for its next piece, and few pieces are suspected if one dies
        self._processes: ProcessPoolExecutor | None = None
        self._children: list[BaseProcess] = []

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:  # also after Ctrl-C: running pieces would continue for minutes
            for process in self._children:
                process.terminate()
        self._stop()

    def submit(self, piece: Work) -> Future[Any]:
        """Hand out a piece, to new processes if an old one died, because its pool is broken then."""
        try:
            return self._started().submit(piece)
        except BrokenProcessPool:
            self._stop()
        try:
            return self._started().submit(piece)
        except BrokenProcessPool:
            raise WorkersError("processes die before they begin; the machine may be out of memory") from None

    def explain_loss(self, error: Exception) -> LostPiece | None:
        return LostPiece() if isinstance(error, BrokenProcessPool) else None

    def _started(self) -> ProcessPoolExecutor:
        """Start processes that inherit only the environment, in which every library has one thread."""
        if self._processes is None:
            others = multiprocessing.active_children()
            with _one_thread():
                self._processes = ProcessPoolExecutor(
                    self.count,
                    mp_context=multiprocessing.get_context("spawn"),
                    initializer=signal.signal,  # Ctrl-C reaches every process; this one ends the others
                    initargs=(signal.SIGINT, signal.SIG_IGN),
                )
                # Processes start on demand; all of them must start while the environment is set.
                wait([self._processes.submit(os.getpid) for _ in range(self.count)])
            self._children = [child for child in multiprocessing.active_children() if child not in others]
        return self._processes

    def _stop(self) -> None:
        if self._processes is not None:
            self._processes.shutdown(cancel_futures=True)
            self._processes, self._children = None, []


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limit numerical libraries of new processes to one thread."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
