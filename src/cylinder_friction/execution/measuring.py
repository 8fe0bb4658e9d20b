"""The cost of a run: processor time, peak memory, and at most 40 samples over time."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import psutil

MOST_SAMPLES = 40


@dataclass(frozen=True)
class Took:
    """Start and end of a run [ms since 1970], and its cost."""

    started_ms: int
    ended_ms: int
    processor_s: float = 0.0  # Processor time of the process and its children
    peak_memory_mb: float = 0.0  # Greatest memory of them together
    samples: list[dict[str, float]] = field(default_factory=list)  # Over time: ``time_ms``, ``memory_mb``, ...


def now_ms() -> int:
    """Return the time of day [ms since 1970]."""
    return time.time_ns() // 1_000_000


@contextmanager
def measured(interval_s: float = 1.0) -> Iterator[Callable[[], Took]]:
    """Sample this process and its children while the block runs; yield a function that returns the result."""
    process, stop, samples, started_ms = psutil.Process(), threading.Event(), list[dict[str, float]](), now_ms()
    begun_s = sum(process.cpu_times()[:4])  # user and system, of the process and of children that have ended
    peak_mb = 0.0

    def sample() -> None:
        nonlocal peak_mb
        memory_mb = 0.0
        for one in [process, *process.children(recursive=True)]:
            with suppress(psutil.Error):  # it ended meanwhile
                memory_mb += one.memory_info().rss / 1e6
        peak_mb = max(peak_mb, round(memory_mb, 1))
        used_s = round(sum(process.cpu_times()[:4]) - begun_s, 2)
        samples.append({"time_ms": now_ms(), "memory_mb": round(memory_mb, 1), "processor_s": used_s})

    def keep_sampling(every_s: float) -> None:
        while not stop.wait(every_s):
            sample()
            if len(samples) >= MOST_SAMPLES:  # in a long run drop every second sample, and sample half as often
                del samples[::2]
                every_s *= 2.0

    thread = threading.Thread(target=keep_sampling, args=(interval_s,), daemon=True, name="resources")
    thread.start()
    try:
        yield lambda: Took(started_ms, int(samples[-1]["time_ms"]), samples[-1]["processor_s"], peak_mb, samples)
    finally:
        stop.set()
        thread.join()
        sample()
