"""What the logger sees: anti-alias filter, offset, gain, drift, noise, linearity, backlash, and twelve bits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numba
import numpy as np
import pandas as pd
from scipy import signal

from cylinder_friction.rig.parameters import BAR_PA

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

    from cylinder_friction.rig.parameters import SensorParameters

    Array = NDArray[np.float64]

LOGGER_COLUMNS = ("Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]")
UNDER_RANGE = 0.01
"""How far below zero a 4-20 mA transmitter is read, as a part of its span."""
MM = 1e-3


def measure(
    sensors: SensorParameters, trace: pd.DataFrame, generator: Generator, session_time_s: float = 0.0
) -> pd.DataFrame:
    """Returns the logger's table, columns ``LOGGER_COLUMNS``, in seconds, bar and millimetres.

    Args:
        sensors: Their parameters.
        trace: What ``simulate`` returned, logged several times as fast as the sensors sample.
        generator: Of the noise.
        session_time_s: Time since the transmitters were zeroed, at the first row [s]; their drift begins there.

    Raises:
        ValueError: The trace's time step does not divide the sample time.
    """
    log_step_s = float(trace["time_s"].iloc[1] - trace["time_s"].iloc[0])
    stride = round(sensors.sample_time_s / log_step_s)
    if stride < 1 or abs(stride * log_step_s - sensors.sample_time_s) > 1e-9:
        raise ValueError(
            f"sample_time_s: got {sensors.sample_time_s} s, but expected a multiple of the trace's step {log_step_s} s"
        )
    time_s = trace["time_s"].to_numpy()[::stride]
    columns: dict[str, Array] = {LOGGER_COLUMNS[0]: time_s}
    for side in (0, 1):
        true_pa = trace[f"pressure_{side + 1}_pa"].to_numpy()
        seen_pa = _anti_alias(true_pa, log_step_s, sensors.anti_alias_hz)[::stride] * sensors.pressure_gain[side]
        seen_pa += sensors.pressure_offset_pa[side] + sensors.pressure_drift_pa_s[side] * (session_time_s + time_s)
        seen_pa += generator.normal(0.0, sensors.pressure_noise_pa, len(time_s))
        span_pa = sensors.pressure_span_pa
        columns[LOGGER_COLUMNS[1 + side]] = _converted(seen_pa, span_pa, sensors.bits, -UNDER_RANGE * span_pa) / BAR_PA
    position_m = _potentiometer(sensors, trace["position_m"].to_numpy())
    seen_m = _anti_alias(position_m, log_step_s, sensors.anti_alias_hz)[::stride]
    seen_m += generator.normal(0.0, sensors.position_noise_m, len(time_s))
    span_m = sensors.position_span_m
    columns[LOGGER_COLUMNS[3]] = _converted(seen_m, span_m, sensors.bits, -UNDER_RANGE * span_m) / MM
    return pd.DataFrame(columns)


def _potentiometer(sensors: SensorParameters, position_m: Array) -> Array:
    """Returns where the wiper stands: the coupling's play first, then the track's linearity error."""
    wiper_m = np.asarray(_backlash(position_m, sensors.backlash_m))
    angle = np.pi * wiper_m / sensors.position_span_m
    first, second = sensors.linearity_m
    return np.asarray(wiper_m + first * np.sin(angle) + second * np.sin(2.0 * angle))


@numba.njit(cache=True)
def _backlash(position_m: Any, play_m: float) -> Any:
    wiper = np.empty_like(position_m)
    at = position_m[0]
    for index in range(len(position_m)):
        at = min(max(at, position_m[index] - 0.5 * play_m), position_m[index] + 0.5 * play_m)
        wiper[index] = at
    return wiper


def _anti_alias(values: Array, step_s: float, corner_hz: float) -> Array:
    """Returns the values behind a second-order Butterworth low-pass, in its steady state at the first of them."""
    sections = signal.butter(2, corner_hz, fs=1.0 / step_s, output="sos")
    start = signal.sosfilt_zi(sections) * values[0]
    filtered, _ = signal.sosfilt(sections, values, zi=start)
    return np.asarray(filtered)


def _converted(values: Array, span: float, bits: int, lowest: float) -> Array:
    step = span / 2**bits
    return np.asarray(np.round(np.clip(values, lowest, span) / step) * step)
