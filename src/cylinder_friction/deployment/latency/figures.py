"""Measured times of single steps as the few figures that a real-time engineer asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Latency:
    """Times of single steps, each figure one that was measured (none is interpolated).

    Attributes:
        steps: How many were timed.
        p50_us, p99_us, p999_us, maximum_us: Quantiles [µs].
        first_us: Median of the first steps after other work, which left the caches to itself [µs].
        preempted: How often the system took the core away meanwhile.
    """

    steps: int
    p50_us: float
    p99_us: float
    p999_us: float
    maximum_us: float
    first_us: float
    preempted: int


def latency_of(
    steps_ns: NDArray[np.int64], first_ns: NDArray[np.int64], timer_ns: float, preempted: int = 0
) -> Latency:
    """Return the figures of measured durations, less what reading the clock itself costs.

    Args:
        steps_ns: Of every timed step, at least one.
        first_ns: Of the first step of each block, at least one.
        timer_ns: Between two readings of the clock with nothing between them.
        preempted: See ``Latency``.
    """
    if len(steps_ns) == 0 or len(first_ns) == 0:
        raise ValueError(f"expected at least one timed step, but got {len(steps_ns)} and {len(first_ns)} first ones")
    own = np.maximum(np.asarray(steps_ns, dtype=np.float64) - timer_ns, 0.0)
    p50, p99, p999, maximum = 1e-3 * np.quantile(own, (0.5, 0.99, 0.999, 1.0), method="inverted_cdf")
    first = 1e-3 * max(float(np.median(first_ns)) - timer_ns, 0.0)
    return Latency(len(own), float(p50), float(p99), float(p999), float(maximum), first, preempted)
