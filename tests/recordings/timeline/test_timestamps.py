import numpy as np
import pytest

from cylinder_friction.recordings.timeline.timestamps import even_rate

RNG = np.random.default_rng(0)
ROWS = np.arange(5000)


STAMPS: dict[str, tuple[np.ndarray, float | None]] = {
    "far from zero": (1e6 + 0.005 * ROWS, 200.0),
    "printed in milliseconds": (np.round(ROWS / 300.0, 3), 300.0),
    "jitter of 1 %": (0.005 * ROWS + RNG.uniform(-5e-5, 5e-5, len(ROWS)), 200.0),
    "drift of 100 parts in a million": (0.005 * ROWS * (1.0 + 1e-4 * ROWS / len(ROWS)), 200.0),
    "one sample lost at the resolution of the stamps": (np.delete(np.round(0.01 * ROWS, 2), 3000), None),
    "one stamp late": (0.005 * ROWS + 0.0015 * (ROWS == 77), None),
    "another rate half way": (np.where(ROWS < 2500, 0.005 * ROWS, 12.5 + 0.0051 * (ROWS - 2500)), None),
    "another rate from a block on": (np.where(ROWS < 3072, 0.005 * ROWS, 15.36 + 0.00502 * (ROWS - 3072)), None),
    "backwards": (-0.005 * ROWS, None),
}


@pytest.mark.parametrize("name", STAMPS)
def test_stamps_are_even_or_not(name: str) -> None:
    time_s, rate_hz = STAMPS[name]
    assert even_rate(time_s) == (rate_hz and pytest.approx(rate_hz, rel=2e-4))
