"""Run jobs side by side in processes of this machine."""

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
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def done_in_order(jobs: Sequence[Callable[[], Done]], processes: int = 1) -> list[Done]:
    """Run jobs that can be pickled, and return their results in the order of the jobs.

    With 1 process the jobs run here. Of more, each takes one thread; ``MonitoringError`` is raised if one dies.
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
