"""Spectra and noise floors of signals that are known."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.evaluation.inspection.spectra import spectrum


def test_the_floor_of_white_noise_is_its_density() -> None:
    noise = np.random.default_rng(0).normal(0.0, 3.0, 60_000)
    found = spectrum(noise, 0.005)
    assert found.noise == pytest.approx(3.0 / np.sqrt(100.0), rel=0.1)
    assert np.isnan(found.converter_noise)


def test_the_floor_of_a_converter_is_that_of_rounding() -> None:
    smooth = np.cumsum(np.random.default_rng(0).normal(0.0, 2.0, 60_000))
    found = spectrum(np.round(smooth), 0.005)
    assert found.converter_noise == pytest.approx(np.sqrt(1.0 / 12.0 / 100.0))
