"""The machine of a measurement, and how quiet it was."""

import os
import platform
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

if sys.platform != "win32":
    import resource

from cylinder_friction.deployment.c_export.compiled import NoCompilerError, compiler_version

QUIET_SHARE = 0.02  # Where others had more of the core than this, the figures are marked as those of a busy machine


@contextmanager
def one_core() -> Iterator[int | None]:
    """Keep this process on its last core, the one least troubled by interrupts; None where the system cannot."""
    if sys.platform != "linux":
        yield None
        return
    before = os.sched_getaffinity(0)
    core = max(before)
    os.sched_setaffinity(0, {core})
    try:
        yield core
    finally:
        os.sched_setaffinity(0, before)


@dataclass(frozen=True)
class Quiet:
    """What others did on the machine during the measurement; None where the system gives no such figure."""

    core_share: float | None  # Of the measuring core's time that others had
    other_cores_share: float | None  # Of the other cores' time that was busy
    load: float | None  # Mean number of runnable processes over the last minute, at the end

    @property
    def is_quiet(self) -> bool | None:
        return None if self.core_share is None else self.core_share < QUIET_SHARE


class QuietWatch:
    """Compares the cores' busy times at its beginning and at ``end``."""

    def __init__(self, core: int | None) -> None:
        self._core, self._busy, self._own = core, _busy_seconds(), time.process_time()

    def end(self) -> Quiet:
        now, own_s = _busy_seconds(), time.process_time() - self._own
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        if self._core is None or self._core not in now:
            return Quiet(None, None, load)
        passed = {
            core: (busy - self._busy[core][0], total - self._busy[core][1]) for core, (busy, total) in now.items()
        }
        busy_s, total_s = passed.pop(self._core)
        others_s, others_total_s = (
            (sum(column) for column in zip(*passed.values(), strict=True)) if passed else (0.0, 0.0)
        )
        return Quiet(
            round(max(0.0, busy_s - own_s) / total_s, 4) if total_s else None,
            round(others_s / others_total_s, 4) if others_total_s else None,
            load,
        )


def preemptions() -> int:
    """Return how often the system has taken the core away from this thread; 0 on Windows, which does not count it."""
    if sys.platform != "win32":
        return resource.getrusage(getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF)).ru_nivcsw
    return 0


def scheduling() -> str:
    """Return how the system schedules this process: ``other`` as any program, ``fifo`` as control loops run."""
    if sys.platform != "linux":
        return "unknown"
    names = {os.SCHED_OTHER: "other", os.SCHED_FIFO: "fifo", os.SCHED_RR: "round robin", os.SCHED_BATCH: "batch"}
    return names.get(os.sched_getscheduler(0), "unknown")


def machine() -> dict[str, Any]:
    """Return processor, caches, system and compiler in words."""
    try:
        version = compiler_version()
    except NoCompilerError:
        version = "none"
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "caches": _caches(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "compiler": version,
        "scheduling": scheduling(),
    }


def _busy_seconds() -> dict[int, tuple[float, float]]:
    """Return busy and total seconds of each core since the start of the system."""
    result = {}
    for core, times in enumerate(psutil.cpu_times(percpu=True)):
        total = sum(times[:8])  # those of guests are among those of users
        result[core] = (total - times.idle - getattr(times, "iowait", 0.0), total)
    return result


def _processor() -> str:
    known: dict[str, str] = {}
    path = Path("/proc/cpuinfo")
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            key, _, value = line.partition(":")
            known.setdefault(key.strip(), value.strip())
    name = known.get("model name") or platform.processor() or "unknown"
    numbers = [f"{key} {known[key]}" for key in ("cpu family", "model", "stepping") if key in known]
    return ", ".join([name, *numbers])


def _caches() -> dict[str, str]:
    result = {}
    for folder in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        level, kind, size = ((folder / name).read_text(encoding="utf-8").strip() for name in ("level", "type", "size"))
        result[f"L{level} {kind.lower()}"] = size
    return result
