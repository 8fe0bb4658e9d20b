"""Smooth pressures, velocity and acceleration: the output of every off-line filter, also as columns of a recording."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import DRIVE_FORCE, LOAD_FORCE, POSITION, SAMPLE_COLUMNS
from cylinder_friction.recordings.line_loss import FLOW_SIGNS, LineLoss
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.noise import noise_deviation

SMOOTH_LOAD = "load_force_smooth_n"
"""The measured load, smoothed as pressures are [N]."""

P1, P2, X = 0, 1, 2
"""Columns of raw samples, shape ``(n, 3)``: pressures of piston and rod side, position."""


@dataclass(frozen=True)
class SmoothSignals:
    """Smooth signals of one recording, each of shape ``(n,)``; extension positive."""

    pressure_1_smooth_pa: Array  # Piston side, gauge [Pa]
    pressure_2_smooth_pa: Array  # Rod side, gauge [Pa]
    velocity_m_s: Array
    acceleration_m_s2: Array


@dataclass(frozen=True)
class SmoothDrive:
    """Smooth signals of a recording with a drive force in place of pressures, each of shape ``(n,)``."""

    drive_force_smooth_n: Array  # Force on the rod, smoothed as pressures are, positive towards extension [N]
    velocity_m_s: Array
    acceleration_m_s2: Array


@dataclass(frozen=True)
class Support:
    """Support of a filter in samples: output t depends on inputs ``t - before`` to ``t + after``."""

    before: int
    after: int


class SignalFilter(ABC):
    """Smooths pressures and differentiates position, over a whole recording."""

    linear: ClassVar[bool] = True
    """Whether the filter is linear, and so has a frequency response."""

    @abstractmethod
    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        """Smooth a force, shape ``(n,)``, as pressures are: with the same delay and bandwidth."""

    @abstractmethod
    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        """Differentiate a position to velocity [m/s] and acceleration [m/s²], each of shape ``(n,)``."""

    @abstractmethod
    def support(self, sample_time_s: float) -> Support:
        """State the support of the filter, the longest of its four outputs."""

    def deviation(self, force_n: Array, sample_time_s: float) -> Array:
        """Estimate the standard deviation that noise leaves in a smoothed force [N], shape ``(n,)``.

        The noise is assumed white and estimated from the force. The error of smoothing the force itself, which is
        largest next to steps, is not included.
        """
        support = self.support(sample_time_s)
        middle = 2 * max(support.before, support.after) + 1
        pulse = np.zeros(2 * middle + 1)
        pulse[middle] = 1.0
        gain = float(np.linalg.norm(self.smooth_force(pulse, sample_time_s)))
        return np.full(len(force_n), gain * noise_deviation(force_n))

    def smooth(self, samples: Array, sample_time_s: float) -> SmoothSignals:
        """Smooth raw samples, shape ``(n, 3)``, taken every ``sample_time_s``."""
        p1, p2 = (self.smooth_force(samples[:, side], sample_time_s) for side in (P1, P2))
        return SmoothSignals(p1, p2, *self.motion(samples[:, X], sample_time_s))


def has_pressures(recording: Recording) -> bool:
    """Check whether both pressures were measured; if so, a drive force beside them is ignored."""
    return all(column in recording.columns for column in SAMPLE_COLUMNS)


def in_chambers(recording: Recording, lines: Mapping[str, LineLoss], velocity_m_s: Array) -> Recording:
    """Subtract the loss of lines, by pressure, at these velocities, shape ``(n,)``, extension positive."""
    lost_pa = {name: line.lost_pa(FLOW_SIGNS[name] * velocity_m_s) for name, line in lines.items()}
    return recording.with_columns(**{name: recording.column(name) - lost_pa[name] for name in lines})


def at_cylinder(recording: Recording, signal_filter: SignalFilter) -> Recording:
    """Correct the pressures from the sensors to the chambers, by the stated loss of the lines.

    While the piston extends, oil flows towards the piston side and away from the rod side.
    """
    lines = recording.metadata.line_loss
    if not lines:
        return recording
    velocity_m_s, _ = signal_filter.motion(recording.column(POSITION), recording.sample_time_s)
    return in_chambers(recording, lines, velocity_m_s)


def smooth_recording(recording: Recording, signal_filter: SignalFilter) -> SmoothSignals | SmoothDrive:
    """Smooth a recording: its pressures, or its drive force if it has no pressures."""
    recording = at_cylinder(recording, signal_filter)
    if has_pressures(recording):
        samples = np.stack([recording.column(column) for column in SAMPLE_COLUMNS]).T  # each signal contiguous
        return signal_filter.smooth(samples, recording.sample_time_s)
    force_n = signal_filter.smooth_force(recording.column(DRIVE_FORCE), recording.sample_time_s)
    return SmoothDrive(force_n, *signal_filter.motion(recording.column(POSITION), recording.sample_time_s))


def smooth_load(recording: Recording, signal_filter: SignalFilter) -> Array | None:
    """Smooth the measured load [N], shape ``(n,)``, as pressures are; None if none was measured."""
    if LOAD_FORCE not in recording.columns:
        return None
    return signal_filter.smooth_force(recording.column(LOAD_FORCE), recording.sample_time_s)


def smooth_columns(recording: Recording, signal_filter: SignalFilter) -> dict[str, Array]:
    """Compute the columns that the filter adds to a recording, by name."""
    columns: dict[str, Array] = dict(vars(smooth_recording(recording, signal_filter)))
    load_n = smooth_load(recording, signal_filter)
    return columns if load_n is None else columns | {SMOOTH_LOAD: load_n}


def filtered(recording: Recording, signal_filter: SignalFilter) -> Recording:
    """Add the filter's columns to a recording, beside its raw ones.

    They have the single precision in which they are stored, thousands of times finer than any sensor's resolution.
    """
    smooth = smooth_columns(recording, signal_filter)
    return recording.with_columns(**{name: values.astype(np.float32) for name, values in smooth.items()})


def signals_of(recording: Recording) -> SmoothSignals | SmoothDrive:
    """Read the smooth signals of a filtered recording.

    Raises:
        RecordingError: The recording was not filtered.
    """
    if has_pressures(recording):
        return SmoothSignals(*(recording.column(field.name) for field in fields(SmoothSignals)))
    return SmoothDrive(*(recording.column(field.name) for field in fields(SmoothDrive)))


def pulse_responses(method: SignalFilter, sample_time_s: float) -> tuple[Array, Array, Array]:
    """Compute a filter's responses to one sample of 1, each of shape ``(2 m + 1,)`` with the pulse at row ``m``.

    In this order: pressure from pressure, velocity from position [1/s], acceleration from position [1/s²].
    """
    support = method.support(sample_time_s)
    middle = 4 * max(support.before, support.after, 8)
    pulse = np.zeros(2 * middle + 1)
    pulse[middle] = 1.0
    return method.smooth_force(pulse, sample_time_s), *method.motion(pulse, sample_time_s)


def window_samples(window_s: float, order: int, sample_time_s: float) -> int:
    """Choose the odd number of samples that lasts nearest to ``window_s``, at least two more than a polynomial's order.

    ``window_s`` is the time between the first and the last sample of the window [s].

    Example:
        >>> from cylinder_friction.signals.smooth_signals import window_samples
        >>> [window_samples(0.05, 2, sample_time_s) for sample_time_s in (0.01, 0.005, 0.001)]
        [7, 11, 51]
    """
    half = math.floor(0.5 * window_s / sample_time_s + 0.5 + 1e-9)
    return max(2 * half + 1, (order + 2) | 1)
