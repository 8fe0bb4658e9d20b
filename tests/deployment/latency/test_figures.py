from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.deployment.latency.figures import latency_of


def test_every_figure_is_one_of_the_measured_times() -> None:
    times = np.random.default_rng(0).permutation(np.arange(1, 10_001)) * 1000
    latency = latency_of(times, np.array([7000, 9000, 50_000]), timer_ns=0.0, preempted=3)
    assert (latency.p50_us, latency.p99_us, latency.p999_us, latency.maximum_us) == (5000.0, 9900.0, 9990.0, 10_000.0)
    assert (latency.steps, latency.first_us, latency.preempted) == (10_000, 9.0, 3)


def test_the_clocks_own_time_is_taken_off_and_never_leaves_less_than_nothing() -> None:
    latency = latency_of(np.array([10, 40, 1040]), np.array([540]), timer_ns=40.0)
    assert (latency.p50_us, latency.maximum_us, latency.first_us) == (0.0, 1.0, 0.5)


@pytest.mark.parametrize(("steps", "first"), [(0, 1), (1, 0)])
def test_nothing_measured_is_refused(steps: int, first: int) -> None:
    with pytest.raises(ValueError, match=f"expected at least one timed step, but got {steps} and {first} first ones"):
        latency_of(np.zeros(steps, dtype=np.int64), np.zeros(first, dtype=np.int64), 0.0)
