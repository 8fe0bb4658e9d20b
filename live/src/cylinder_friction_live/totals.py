"""Counts over all sessions for ``/metrics``: flags of estimates, and durations of messages."""

from bisect import bisect_left

import numpy as np

from cylinder_friction.realtime.flags import Flag

_COUNTED_BYTES = 1 << 16
_VALUES = 2 * max(Flag)
BOUNDS_S = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0)
"""Upper bounds of the classes of delays [s]; one more class is above the last."""


class FlagTotals:
    """Counts of estimates and of their flags."""

    def __init__(self) -> None:
        self._waiting = bytearray()
        self._counts = np.zeros(_VALUES, dtype=np.int64)  # Counts by the value of the flags

    def note(self, flags: bytes) -> None:
        """Count the flags of estimates; cheap, as most of the work waits until many have come."""
        self._waiting += flags
        if len(self._waiting) > _COUNTED_BYTES:
            self._count()

    def totals(self) -> tuple[int, dict[str, int]]:
        """Count the estimates, and the estimates with each flag."""
        self._count()
        values = np.arange(_VALUES)
        return int(self._counts.sum()), {flag.name or "": int(self._counts[values & flag > 0].sum()) for flag in Flag}

    def _count(self) -> None:
        if self._waiting:
            self._counts += np.bincount(np.frombuffer(self._waiting, "<u4"), minlength=_VALUES)
            self._waiting.clear()


class Delays:
    """Durations from a message's arrival until its estimates were sent, in classes."""

    def __init__(self) -> None:
        self._counts, self._sum_s = [0] * (len(BOUNDS_S) + 1), 0.0

    def note(self, delay_s: float) -> None:
        """Count one duration."""
        self._counts[bisect_left(BOUNDS_S, delay_s)] += 1
        self._sum_s += delay_s

    def buckets(self) -> tuple[list[tuple[str, float]], float]:
        """Count durations up to each bound, as Prometheus needs, and sum them all [s]."""
        names = [*map(str, BOUNDS_S), "+Inf"]
        return list(zip(names, np.cumsum(self._counts).tolist(), strict=True)), self._sum_s
