"""Power spectra of the signals, and the noise that their sensors and converters leave."""

import math
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import DRIVE_FORCE, POSITION, PRESSURES
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.noise import quantisation_step
from cylinder_friction.signals.smooth_signals import has_pressures

SEGMENT_S = 8.0
"""Length of a Welch segment: motion slower than this is not of interest."""

NOISE_SHARE = 0.6
"""The noise level is read above this share of half the sample rate, where hardly any motion is left."""

REAL_STEP = 1e-5
"""A smallest step below this share of the span is no converter's, but that of computed numbers."""


@dataclass(frozen=True)
class Spectrum:
    """Amplitude density of one signal."""

    frequency_hz: Array  # Shape ``(k,)`` [Hz], without zero
    density: Array  # Shape ``(k,)``, in the signal's unit over the root of a hertz
    noise: float  # What the sensor's noise is at, in the same unit: the median of the highest frequencies
    converter_noise: float  # What rounding to the converter's step alone would be at; NaN if no step shows


def signal_spectra(recording: Recording, velocity_m_s: Array) -> dict[str, Spectrum]:
    """Collect the spectra of a recording's signals in SI units, by column.

    These are its pressures, or its drive force if it has none, its position, its smooth velocity, shape ``(n,)``,
    and as ``raw_velocity_m_s`` differences of the raw position.
    """
    position_m, sample_time_s = recording.column(POSITION), recording.sample_time_s
    signals = {name: recording.column(name) for name in (PRESSURES if has_pressures(recording) else [DRIVE_FORCE])}
    signals |= {POSITION: position_m, "raw_velocity_m_s": np.diff(position_m) / sample_time_s}
    signals |= {"velocity_m_s": velocity_m_s}
    return {name: spectrum(values, sample_time_s) for name, values in signals.items()}


def spectrum(values: Array, sample_time_s: float) -> Spectrum:
    """Compute the spectrum of a signal, shape ``(n,)``, from averaged segments (Welch 1967)."""
    from scipy.signal import detrend, welch  # half a second that most commands need not wait for

    rate_hz = 1.0 / sample_time_s
    segment = min(len(values), 1 << math.ceil(math.log2(SEGMENT_S * rate_hz)))
    frequency_hz, power = welch(values, rate_hz, nperseg=segment, detrend=detrend)
    density = np.sqrt(power)
    high = frequency_hz >= NOISE_SHARE * 0.5 * rate_hz
    step = quantisation_step(values)
    real = step > REAL_STEP * float(np.ptp(values))
    return Spectrum(
        frequency_hz=frequency_hz[1:],
        density=density[1:],
        noise=float(np.median(density[high])),
        # Rounding has a variance of step²/12, spread evenly up to half the sample rate.
        converter_noise=step / math.sqrt(6.0 * rate_hz) if real else math.nan,
    )
