import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.recordings.timeline.windowed_sinc import windowed_sinc

AWAY = 40
"""Samples of the lower rate from an end beyond which its continuation plays no part."""


def sine(frequency_hz: float, time_s: np.ndarray) -> np.ndarray:
    return np.sin(2.0 * np.pi * frequency_hz * time_s + 0.3)


def downsampled(frequency_hz: float, phase: float, to_hz: float = 200.0) -> tuple[np.ndarray, np.ndarray]:
    """Return wanted instants and a sine taken from 1000 Hz there, away from the ends."""
    wanted_s = np.arange(0.0, 5.9, 1.0 / to_hz) + phase / to_hz
    values = windowed_sinc(sine(frequency_hz, np.arange(6000) / 1000.0), 1000.0 * wanted_s, to_hz / 1000.0)
    return wanted_s[AWAY:-AWAY], values[AWAY:-AWAY]


@given(st.floats(0.1, 80.0), st.floats(100.0, 480.0), st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_what_the_rate_carries_comes_through_the_rest_loses_60_db(low: float, high: float, phase: float) -> None:
    wanted_s, values = downsampled(low, phase)
    assert np.abs(values - sine(low, wanted_s)).max() < 1e-3
    assert np.abs(downsampled(high, phase)[1]).max() < 1e-3


@pytest.mark.parametrize("ratio", [0.2, 0.9, 1.0, 2.7])
def test_a_straight_line_stays_straight_to_its_ends(ratio: float) -> None:
    rows = 1000
    positions = np.arange(0.0, rows - 1, 1.0 / ratio)
    values = windowed_sinc(3.0 + 2.0 * np.arange(rows), positions, ratio)
    # As a share of the line's rise over one sample of the lower rate.
    assert np.abs(values - (3.0 + 2.0 * positions)).max() < 5e-3 * 2.0 / min(1.0, ratio)
