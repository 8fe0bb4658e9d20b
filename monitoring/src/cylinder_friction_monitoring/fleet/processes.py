"""Work on cylinders side by side, in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import TypeVar

Done = TypeVar("Done")
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Died:
    """A piece of work whose process died twice: once beside others and once alone."""

    reason: str = "the process that did it died; it may have run out of memory"


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def done_in_order(jobs: Sequence[Callable[[], Done]], processes: int = 1) -> list[Done | Died]:
    """Return what each job returned, in their order; a process that dies costs its own job alone.

    Args:
        jobs: What can be pickled and called, such as a ``functools.partial``.
        processes: How many work side by side, each on one thread; 1: all work is done here.
    """
    if processes < 2 or len(jobs) < 2:
        return [job() for job in jobs]
    found = _tried(jobs, processes)
    return [each if not isinstance(each, Died) else _tried([job], 1)[0] for job, each in zip(jobs, found, strict=True)]


def _tried(jobs: Sequence[Callable[[], Done]], processes: int) -> list[Done | Died]:
    """Do jobs in fresh processes; if one dies, all jobs that have not returned count as died."""
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")  # read when a process loads its libraries
    found = list[Done | Died]()
    pool = ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"))
    try:
        for future in [pool.submit(job) for job in jobs]:
            try:
                found.append(future.result())
            except BrokenProcessPool:
                found.append(Died())
    finally:
        pool.shutdown(cancel_futures=True)
    return found
