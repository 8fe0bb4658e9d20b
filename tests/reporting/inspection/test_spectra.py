"""Spectra and noise floors of signals that are known."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.reporting.inspection.spectra import spectrum
from cylinder_friction.reporting.inspection.standstill import noise_rms, standstill_rows


def test_the_floor_of_white_noise_is_its_density() -> None:
    noise = np.random.default_rng(0).normal(0.0, 3.0, 60_000)
    found = spectrum(noise, 0.005)
    assert found.floor == pytest.approx(3.0 / np.sqrt(100.0), rel=0.1)
    assert np.isnan(found.converter_floor)


def test_the_floor_of_a_converter_is_that_of_rounding() -> None:
    smooth = np.cumsum(np.random.default_rng(0).normal(0.0, 2.0, 60_000))
    found = spectrum(np.round(smooth), 0.005)
    assert found.converter_floor == pytest.approx(np.sqrt(1.0 / 12.0 / 100.0))


def test_a_tone_stands_where_it_is() -> None:
    time_s = 0.005 * np.arange(20_000)
    found = spectrum(np.sin(2.0 * np.pi * 12.5 * time_s), 0.005)
    assert found.frequency_hz[np.argmax(found.density)] == pytest.approx(12.5, abs=0.13)


def test_a_short_signal_has_a_spectrum_too() -> None:
    assert len(spectrum(np.arange(10.0) % 3.0, 0.005).frequency_hz) == 5


def test_rest_is_found_between_motions_and_noise_is_about_its_mean() -> None:
    generator = np.random.default_rng(0)
    velocity = np.concatenate([np.zeros(1000), np.full(1000, 0.01), np.zeros(1000)])
    position = np.cumsum(velocity) * 0.005 + generator.normal(0.0, 1e-5, 3000)
    rest = standstill_rows(position, 0.005)
    assert not rest[980:2020].any()
    assert rest[100:800].all()
    assert rest[2200:2900].all()
    assert noise_rms(position, rest) == pytest.approx(1e-5, rel=0.05)
    assert standstill_rows(position, 0.005, around_rows=200).sum() < rest.sum()


def test_nothing_rests_in_a_recording_shorter_than_a_rest() -> None:
    assert not standstill_rows(np.zeros(20), 0.005).any()
    assert np.isnan(noise_rms(np.zeros(20), np.zeros(20, dtype=bool)))
