"""Run jobs side by side in processes of this machine."""

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import TypeVar

from cylinder_friction_monitoring.errors import MonitoringError

Done = TypeVar("Done")
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def outcomes(jobs: Sequence[Callable[[], Done]], processes: int = 1) -> list[Done | Exception]:
    """Run jobs that can be pickled. Return what each returned or raised, in the order of the jobs.

    With 1 process, the jobs run in this process. With more, each process has one thread. If a process dies, the
    unfinished jobs run again, each in a process of its own, so that only the job that kills its process fails.
    """
    if processes < 2:
        return [_outcome(job) for job in jobs]
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")  # read when a process loads its libraries
    found = _of_pool(jobs, processes)
    for place, job in enumerate(jobs):
        if isinstance(found[place], BrokenProcessPool):
            (again,) = _of_pool([job], 1)
            died = MonitoringError("its process died; it may have run out of memory")
            found[place] = died if isinstance(again, BrokenProcessPool) else again
    return found


def _of_pool(jobs: Sequence[Callable[[], Done]], processes: int) -> list[Done | Exception]:
    pool = ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"))
    try:
        begun = [_outcome(partial(pool.submit, job)) for job in jobs]
        return [each if isinstance(each, Exception) else _outcome(each.result) for each in begun]
    finally:
        pool.shutdown(cancel_futures=True)


def _outcome(job: Callable[[], Done]) -> Done | Exception:
    try:
        return job()
    except Exception as error:
        return error
