"""Limit cycles, settling and reversals on signals made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from friction_benchmark.in_the_loop.courses import COURSES, course
from friction_benchmark.in_the_loop.measures import constant_stretches, limit_cycle, reversals, settling_s
from friction_benchmark.servo_rig.dynamics import TICK_S

TIME_S = TICK_S * np.arange(3000)
NOISE = np.random.default_rng(0).normal(size=len(TIME_S))
SINE = 2e-5 * np.sin(2.0 * np.pi * 2.5 * TIME_S)


@pytest.mark.parametrize(
    ("signal", "amplitude_m", "period_s"),
    [
        (SINE, 2e-5, 0.4),
        (SINE + 1e-6 * NOISE + 5e-5, 2.2e-5, 0.4),
        (3e-5 * (TIME_S / 0.5 % 1.0), 1.5e-5, 0.5),
        (2e-5 * np.sign(SINE), 2e-5, 0.4),
        (np.minimum(TIME_S, 1.0) * SINE, 2e-5, 0.4),
    ],
    ids=["sine", "noisy sine", "stick-slip", "jumps", "growing"],
)
def test_limit_cycles_are_found(signal: np.ndarray, amplitude_m: float, period_s: float) -> None:
    found = limit_cycle(signal)
    assert found is not None
    assert found == (pytest.approx(amplitude_m, rel=0.1), pytest.approx(period_s, rel=0.1))


@pytest.mark.parametrize(
    "signal",
    [
        np.zeros(3000),
        1e-4 * TIME_S,
        1e-6 * NOISE,
        np.exp(-2.0 * TIME_S) * SINE,
        SINE * (TIME_S < 1.5),
        0.2 * SINE,
        1e-5 * np.cumsum(NOISE) / 30.0,
        np.where(TIME_S < 1.0, 5e-5, 0.0),
        2e-5 * np.sin(2.0 * np.pi * 0.5 * TIME_S),
    ],
    ids=["rest", "ramp", "noise", "dies away", "ends", "too small", "wanders", "one step", "too slow to tell"],
)
def test_what_is_no_limit_cycle_is_not_taken_for_one(signal: np.ndarray) -> None:
    assert limit_cycle(signal) is None


def test_settling_is_the_last_time_outside() -> None:
    error = np.zeros(3000)
    error[1000:1200] = 1e-4
    error[2000:2050], error[2090] = 1e-4, -2e-5
    assert settling_s(error, np.array([1000, 2000])) == pytest.approx(0.5 * (0.200 + 0.091))


def test_reversals_are_starts_and_turns() -> None:
    speed = np.concatenate([np.zeros(500), np.full(1000, 5e-3), np.full(1000, -5e-3), np.zeros(500)])
    assert list(np.flatnonzero(reversals(speed))) == [*range(500, 800), *range(1500, 1800)]
    assert [(part.start, part.stop) for part in constant_stretches(speed)] == [(800, 1500), (1800, 2500)]


@pytest.mark.parametrize("name", COURSES)
def test_courses_begin_and_end_at_rest_within_the_stroke(name: str) -> None:
    reference_m, load_n = course(name)
    assert len(reference_m) == len(load_n) + 1
    assert 0.1 < reference_m.min() < reference_m.max() < 0.25
    assert load_n[0] == load_n[-1] == 0.0
