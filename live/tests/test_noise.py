"""The noise of a session's pressures, from windows of its samples."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction_live.noise import ROWS_BETWEEN, WINDOW_ROWS, NoiseWindow

EVERY = WINDOW_ROWS + ROWS_BETWEEN


@pytest.mark.parametrize(("noisy", "expected_pa"), [((), 100.0), ((0, 2), 100.0), ((0, 1, 2), 400.0)])
def test_pressures_that_swing_for_a_while_are_not_noisy(noisy: tuple[int, ...], expected_pa: float) -> None:
    noise_pa = np.full(3 * EVERY, 100.0)
    for window in noisy:
        noise_pa[window * EVERY : window * EVERY + WINDOW_ROWS] = 400.0
    samples = np.random.default_rng(0).normal(0.0, 1.0, (len(noise_pa), 3)) * noise_pa[:, None] * [1.0, 1.0, 0.0]
    measured = NoiseWindow(SAMPLE_COLUMNS)
    for block in np.array_split(samples[: 2 * EVERY], 100):
        measured.take(block)
    assert measured.noise_pa == 0.0  # two windows state nothing
    for block in np.array_split(samples[2 * EVERY :], 50):
        measured.take(block)
    assert measured.noise_pa == pytest.approx(expected_pa, rel=0.1)
