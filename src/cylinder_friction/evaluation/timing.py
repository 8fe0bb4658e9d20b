"""Time of one step [s], measured one sample at a time, as in a control loop."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter_ns

import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.recordings.recording import Recording


@dataclass(frozen=True)
class StepTime:
    """Measured time of one step [s]; it differs between runs and machines."""

    steps: int
    p50_s: float
    p99_s: float
    maximum_s: float


def time_steps(
    estimator: FrictionEstimator, recording: Recording, steps: int, warm_up: int = 50, maximum_seconds: float = 3.0
) -> StepTime:
    """Step a fresh stream through the recording's first samples, repeated if it is short, and time every step.

    The first ``warm_up`` steps are not timed, so that compilation and caches do not count. Timing ends after
    ``maximum_seconds``, so that a slow estimator does not delay the others.
    """
    samples = recording.samples(estimator.inputs)[: steps + warm_up].tolist()
    stream = estimator.stream()
    for index in range(warm_up):
        stream.step(*samples[index % len(samples)])
    durations: list[int] = []
    deadline = perf_counter_ns() + round(1e9 * maximum_seconds)
    for index in range(warm_up, warm_up + steps):
        sample = samples[index % len(samples)]
        before = perf_counter_ns()
        stream.step(*sample)
        after = perf_counter_ns()
        durations.append(after - before)
        if after > deadline:
            break
    seconds = 1e-9 * np.array(durations, dtype=np.float64)
    return StepTime(len(seconds), float(np.median(seconds)), float(np.quantile(seconds, 0.99)), float(np.max(seconds)))
