"""Work shared among processes of one thread each; a process that dies costs its own piece of work, no other."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from multiprocessing.process import BaseProcess

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Died:
    """A piece of work whose process died twice: once beside others and once alone."""

    reason: str = "the process that did it died; it may have run out of memory"


Work = Callable[[], Any]
"""Whatever can be pickled and called, such as a ``functools.partial`` of a module's function."""


class Workers:
    """Processes that stay for one batch of work after another.

    Args:
        count: How many; 1 does all the work in this process.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._processes: ProcessPoolExecutor | None = None
        self._children: list[BaseProcess] = []

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:  # Ctrl-C among them: what is running would go on for minutes
            for process in self._children:
                process.terminate()
        self._stop()

    def do_all(self, pieces: Sequence[Work]) -> Iterator[tuple[int, Any]]:
        """Yield the number of each piece and what it returned, or ``Died``, as they finish.

        Pieces are independent of each other; an exception in one is raised here, so each should catch its own.
        """
        if self.count == 1:
            for number, piece in enumerate(pieces):
                yield number, piece()
            return
        waiting = list(enumerate(pieces))
        suspects: list[tuple[int, Work]] = []
        while waiting:
            yield from self._until_one_dies(waiting, suspects)
        for number, piece in suspects:
            yield number, self._alone(piece)

    def _until_one_dies(self, waiting: list[tuple[int, Work]], suspects: list[tuple[int, Work]]) -> Iterator[Any]:
        running: dict[Future[Any], tuple[int, Work]] = {}
        try:
            while waiting or running:
                # No more at a time than there are processes: if one dies, few are under suspicion.
                while waiting and len(running) < self.count:
                    future = self._started().submit(waiting[0][1])
                    running[future] = waiting.pop(0)
                finished, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    result = future.result()
                    number, _ = running.pop(future)
                    yield number, result
        except BrokenProcessPool:
            suspects += running.values()
            self._stop()

    def _alone(self, piece: Work) -> Any:
        try:
            return self._started().submit(piece).result()
        except BrokenProcessPool:
            self._stop()
            return Died()

    def _started(self) -> ProcessPoolExecutor:
        """Return processes that inherit nothing but the environment, in which every library has one thread."""
        if self._processes is None:
            others = multiprocessing.active_children()
            with _one_thread():
                self._processes = ProcessPoolExecutor(
                    self.count,
                    mp_context=multiprocessing.get_context("spawn"),
                    initializer=signal.signal,  # Ctrl-C reaches every process; this one ends the others
                    initargs=(signal.SIGINT, signal.SIG_IGN),
                )
                # They begin as they are asked; all of them must while the environment is as it should be.
                wait([self._processes.submit(os.getpid) for _ in range(self.count)])
            self._children = [child for child in multiprocessing.active_children() if child not in others]
        return self._processes

    def _stop(self) -> None:
        if self._processes is not None:
            self._processes.shutdown(cancel_futures=True)
            self._processes, self._children = None, []


@contextmanager
def _one_thread() -> Iterator[None]:
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
