"""From a recording to its smooth signals, and back from a recording that has them as columns."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.columns import DRIVE_FORCE, SAMPLE_COLUMNS
from cylinder_friction.signals.smooth import SmoothDrive, SmoothSignals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.signals.smooth import SignalFilter

LOAD_FORCE = "load_force_n"
"""External force that resists extension, measured [N]."""

SMOOTH_LOAD = "load_force_smooth_n"
"""The same, smoothed as pressures are [N]."""


def has_pressures(recording: Recording) -> bool:
    """Return whether both pressures were measured; where they were, a drive force beside them is not looked at."""
    return all(column in recording.table.columns for column in SAMPLE_COLUMNS)


def smooth_recording(recording: Recording, signal_filter: SignalFilter) -> SmoothSignals | SmoothDrive:
    """Return the smooth signals of a recording: of its pressures, or of its drive force where it has no pressures."""
    if has_pressures(recording):
        samples = np.stack([recording.column(column) for column in SAMPLE_COLUMNS]).T  # each signal in one piece
        return signal_filter.smooth(samples, recording.sample_time_s)
    force_n = signal_filter.smooth_force(recording.column(DRIVE_FORCE), recording.sample_time_s)
    return SmoothDrive(force_n, *signal_filter.motion(recording.column("position_m"), recording.sample_time_s))


def smooth_load(recording: Recording, signal_filter: SignalFilter) -> NDArray[np.float64] | None:
    """Return the measured load [N], shape ``(n,)``, smoothed as pressures are; None where none was measured."""
    if LOAD_FORCE not in recording.table.columns:
        return None
    return signal_filter.smooth_force(recording.column(LOAD_FORCE), recording.sample_time_s)


def smooth_columns(recording: Recording, signal_filter: SignalFilter) -> dict[str, NDArray[np.float64]]:
    """Return every column that the filter adds to a recording, by name."""
    columns = smooth_recording(recording, signal_filter).columns()
    load_n = smooth_load(recording, signal_filter)
    return columns if load_n is None else columns | {SMOOTH_LOAD: load_n}


def filtered(recording: Recording, signal_filter: SignalFilter) -> Recording:
    """Return a recording with the filter's columns beside its raw ones.

    They are in single precision, as they are stored: thousands of times finer than any sensor's resolution.
    """
    smooth = smooth_columns(recording, signal_filter)
    return recording.with_columns(**{name: values.astype(np.float32) for name, values in smooth.items()})


def signals_of(recording: Recording) -> SmoothSignals | SmoothDrive:
    """Return the smooth signals that the filter stage added to a recording.

    Raises:
        RecordingError: The recording has not been filtered.
    """
    if has_pressures(recording):
        return SmoothSignals(*(recording.column(field.name) for field in fields(SmoothSignals)))
    return SmoothDrive(*(recording.column(field.name) for field in fields(SmoothDrive)))
