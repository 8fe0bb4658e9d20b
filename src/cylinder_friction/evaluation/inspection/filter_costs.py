"""The cost of every filter: its delay, its gain, and the noise that it leaves."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.evaluation.inspection.spectra import spectrum
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.motion import LEAST_STANDSTILL_S, noise_rms, standstill_rows
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.smooth_signals import SignalFilter, Support, pulse_responses
from cylinder_friction.signals.zero_phase import SavitzkyGolay

HALF_POWER = 0.5**0.5
"""The gain of a filter at its -3 dB bandwidth."""

LEAST_GAIN = 0.1
"""Gain below which the delay no longer matters."""

MOTION_HZ = 3.0
"""Frequency of brisk motion [Hz], for which a filter can be late or early although it is exact for slow motion."""

FREQUENCIES = 150
"""Points of a drawn response."""


@dataclass(frozen=True)
class FilterCost:
    """Delay, gain and noise of one filter at one sample rate."""

    name: str  # Name of the filter
    causal: bool  # Whether it can run in real time; the others look ahead
    # Delay of slow changes [s]
    pressure_delay_s: float
    velocity_delay_s: float
    acceleration_delay_s: float
    # Delay of velocity at ``MOTION_HZ``, brisk motion of a hand or valve [s]
    velocity_delay_in_motion_s: float
    # Frequency at which half the power is left [Hz]; infinite without one
    pressure_bandwidth_hz: float
    velocity_bandwidth_hz: float
    velocity_noise_m_s: float  # Root mean square of the velocity at this recording's standstill [m/s]; NaN without one
    velocity_noise_from_sensor_m_s: float  # The part from the position sensor's noise if that is white [m/s]
    frequency_hz: Array  # Frequencies of the response, shape ``(k,)`` [Hz]
    velocity_gain: Array  # Velocity out over velocity in, shape ``(k,)``
    velocity_lag_s: Array  # Its phase delay, shape ``(k,)`` [s]; NaN from the first gain below ``LEAST_GAIN`` on


def with_causal_twins(filters: Mapping[str, SignalFilter]) -> dict[str, tuple[SignalFilter, bool]]:
    """Collect the filters, each followed by its causal twin if it has one; True marks a causal filter."""
    found: dict[str, tuple[SignalFilter, bool]] = {}
    for name, method in filters.items():
        found[name] = (method, isinstance(method, MovingAverage))
        if isinstance(method, SavitzkyGolay):
            found[f"{name}, one-sided"] = (method.causal(), True)
        if isinstance(method, RtsSmoother):
            found[f"{name}, Kalman filter"] = (method.causal(), True)
    return found


def filter_costs(filters: Mapping[str, SignalFilter], recording: Recording) -> tuple[list[FilterCost], list[str]]:
    """Measure the cost of every filter and of its causal twin; return also why others are left out."""
    costs, left_out = [], []
    for name, (method, causal) in with_causal_twins(filters).items():
        try:
            costs.append(_cost(name, causal, method, recording))
        except ValueError as error:
            left_out.append(f"{name}: {error}")
    return costs, left_out


def _cost(name: str, causal: bool, method: SignalFilter, recording: Recording) -> FilterCost:
    if not method.linear:
        raise ValueError("its windows depend on the signal, so that it has no frequency response of its own")
    sample_time_s, position_m = recording.sample_time_s, recording.column("position_m")
    velocity_m_s, _ = method.motion(position_m, sample_time_s)
    position_noise_m = spectrum(position_m, sample_time_s).noise * math.sqrt(0.5 / sample_time_s)
    pressure, velocity, acceleration = pulse_responses(method, sample_time_s)
    frequency_hz = np.geomspace(0.05, 0.5 / sample_time_s, FREQUENCIES)
    pressure_gain = np.abs(_response(pressure, 0, frequency_hz, sample_time_s))
    response = _response(velocity, 1, frequency_hz, sample_time_s)
    gain = np.abs(response)
    left = np.minimum.accumulate(gain) > LEAST_GAIN
    lag_s = np.where(left, -np.unwrap(np.angle(response)) / (2.0 * math.pi * frequency_hz), np.nan)
    return FilterCost(
        name=name,
        causal=causal,
        pressure_delay_s=_delay_s(pressure, 0, sample_time_s),
        velocity_delay_s=_delay_s(velocity, 1, sample_time_s),
        acceleration_delay_s=_delay_s(acceleration, 2, sample_time_s),
        velocity_delay_in_motion_s=float(np.interp(MOTION_HZ, frequency_hz, lag_s)),
        pressure_bandwidth_hz=_bandwidth_hz(frequency_hz, pressure_gain),
        velocity_bandwidth_hz=_bandwidth_hz(frequency_hz, gain),
        velocity_noise_m_s=_standstill_noise(velocity_m_s, position_m, method.support(sample_time_s), sample_time_s),
        velocity_noise_from_sensor_m_s=position_noise_m * float(np.sqrt(np.sum(velocity**2))),
        frequency_hz=frequency_hz,
        velocity_gain=gain,
        velocity_lag_s=lag_s,
    )


def _delay_s(pulse_response: Array, derivative: int, sample_time_s: float) -> float:
    """Compute the delay of a slow change of the ``derivative``-th derivative [s].

    The output for a ramp of that derivative, t^(k+1)/(k+1)!, is the ramp less its delay; at t = 0 the ramp is 0.
    """
    lag_s = sample_time_s * (np.arange(len(pulse_response)) - len(pulse_response) // 2)
    order = derivative + 1
    ramp = float(np.sum(pulse_response * (-lag_s) ** order)) / math.factorial(order)
    constant = float(np.sum(pulse_response * (-lag_s) ** derivative)) / math.factorial(derivative)
    return -ramp / constant


def _response(
    pulse_response: Array, derivative: int, frequency_hz: Array, sample_time_s: float
) -> NDArray[np.complex128]:
    """Compute output over the true ``derivative`` of the input at each frequency, shape ``(k,)``."""
    lag_s = sample_time_s * (np.arange(len(pulse_response)) - len(pulse_response) // 2)
    turning = 2j * math.pi * frequency_hz
    return np.asarray(np.exp(-np.outer(turning, lag_s)) @ pulse_response / turning**derivative)


def _bandwidth_hz(frequency_hz: Array, gain: Array) -> float:
    below = np.flatnonzero(gain < HALF_POWER)
    if len(below) == 0:
        return math.inf
    row = int(below[0])
    if row == 0:
        return float(frequency_hz[0])
    return float(np.interp(HALF_POWER, gain[[row, row - 1]], frequency_hz[[row, row - 1]]))


def _standstill_noise(velocity_m_s: Array, position_m: Array, support: Support, sample_time_s: float) -> float:
    rest = standstill_rows(position_m, sample_time_s, max(support.before, support.after))
    return noise_rms(velocity_m_s, rest) if rest.sum() * sample_time_s >= LEAST_STANDSTILL_S else math.nan
