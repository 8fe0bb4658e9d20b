"""A sender's clock that runs fast or slow is noticed after a minute; one that is set anew is not taken for one."""

from __future__ import annotations

import pytest

from cylinder_friction.live.clock_check import ClockCheck


@pytest.mark.parametrize(("ppm", "wrong"), [(0.0, False), (150.0, False), (300.0, True), (-300.0, True)])
def test_a_rate_that_is_wrong_is_noticed(ppm: float, wrong: bool) -> None:
    check = ClockCheck(0.005)
    for index in range(0, 24_000, 10):
        jitter_s = 0.001 * (index % 3 - 1)
        check.note(index, 1e9 + 0.005 * index * (1.0 + 1e-6 * ppm) + jitter_s)
    assert check.wrong is wrong
    assert check.deviation_ppm == pytest.approx(ppm, abs=20.0)
    assert check.jumps == 0


def test_a_clock_that_is_set_is_a_jump_and_no_rate() -> None:
    check = ClockCheck(0.005)
    for index in range(0, 24_000, 10):
        check.note(index, 0.005 * index + (3600.0 if index > 6_000 else 0.0))
    assert check.jumps == 1
    assert not check.wrong
