"""Work on cylinders side by side, in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from cylinder_friction_monitoring.errors import MonitoringError

Done = TypeVar("Done")
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def done_in_order(jobs: Sequence[Callable[[], Done]], processes: int = 1) -> list[Done]:
    """Return what each job returned, in their order.

    Args:
        jobs: What can be pickled and called, such as a ``functools.partial``.
        processes: How many work side by side, each on one thread; 1: all work is done here.

    Raises:
        MonitoringError: A process died.
    """
    if processes < 2:
        return [job() for job in jobs]
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")  # read when a process loads its libraries
    pool = ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"))
    try:
        return [future.result() for future in [pool.submit(job) for job in jobs]]
    except BrokenProcessPool:
        advice = "run the same command again, with --workers 1 if it happens again"
        raise MonitoringError(f"a process died; it may have run out of memory; {advice}") from None
    finally:
        pool.shutdown(cancel_futures=True)
