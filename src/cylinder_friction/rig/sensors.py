"""Sensors and logger: anti-alias filter, offset, gain, drift, noise, linearity, backlash and a 12-bit converter."""

from pathlib import Path
from typing import Any

import numba
import numpy as np
import pandas as pd
from numpy.random import Generator
from scipy import signal

from cylinder_friction.arrays import Array
from cylinder_friction.rig.parameters import BAR_PA, HydraulicParameters, SensorParameters
from cylinder_friction.rig.simulate import whole_steps

LOGGER_COLUMNS = ("Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]", "Oil temperature [degC]")
LOAD_COLUMN = "Load [N]"
"""Further column if there is a load cell on the rod; positive if the load resists extension."""
UNDER_RANGE = 0.01  # Lowest reading of a 4-20 mA transmitter, as a share of its span below zero
MM = 1e-3
DECIMALS = 3
"""Decimals of every number that the logger writes: finer than its converter's step in bar and in millimetres."""


def measure(
    sensors: SensorParameters,
    trace: pd.DataFrame,
    generator: Generator,
    session_time_s: float = 0.0,
    *,
    load_cell: bool = False,
) -> pd.DataFrame:
    """Measure a trace as the logger does: columns ``LOGGER_COLUMNS``, in seconds, bar, millimetres and °C.

    ``trace`` is a result of ``simulate``. The transmitters were zeroed ``session_time_s`` before its first row [s];
    their drift begins there. With a ``load_cell``, its column ``LOAD_COLUMN`` [N] comes last.

    Raises:
        ValueError: The trace's time step does not divide the sample time.
    """
    log_step_s = float(trace["time_s"].iloc[1] - trace["time_s"].iloc[0])
    stride = whole_steps(sensors.sample_time_s, log_step_s, "sample_time_s", "the trace's step")
    trace_s = trace["time_s"].to_numpy()
    time_s = trace_s[::stride]
    if sensors.jitter_s:
        time_s = np.maximum(time_s + generator.uniform(-sensors.jitter_s, sensors.jitter_s, len(time_s)), time_s[0])
    columns: dict[str, Array] = {LOGGER_COLUMNS[0]: time_s}

    def sampled(values: Array) -> Array:
        return np.asarray(np.interp(time_s, trace_s, values))

    for side in (0, 1):
        true_pa = _transmitted(sensors, trace, side, log_step_s)
        seen_pa = sampled(_anti_alias(true_pa, log_step_s, sensors.anti_alias_hz)) * sensors.pressure_gain[side]
        seen_pa += sensors.pressure_offset_pa[side] + sensors.pressure_drift_pa_s[side] * (session_time_s + time_s)
        seen_pa += generator.normal(0.0, sensors.pressure_noise_pa, len(time_s))
        span_pa = sensors.pressure_span_pa
        columns[LOGGER_COLUMNS[1 + side]] = _converted(seen_pa, span_pa, sensors.bits, -UNDER_RANGE * span_pa) / BAR_PA
    position_m = _potentiometer(sensors, trace["position_m"].to_numpy())
    seen_m = sampled(_anti_alias(position_m, log_step_s, sensors.anti_alias_hz))
    seen_m += generator.normal(0.0, sensors.position_noise_m, len(time_s))
    span_m = sensors.position_span_m
    if sensors.position_step_m:
        seen_m = np.round(seen_m / sensors.position_step_m) * sensors.position_step_m
    else:
        seen_m = _converted(seen_m, span_m, sensors.bits, -UNDER_RANGE * span_m)
    columns[LOGGER_COLUMNS[3]] = seen_m / MM
    late_c = sampled(_late(trace["oil_temperature_c"].to_numpy(), sensors.temperature_lag_s, log_step_s))
    seen_c = late_c + sensors.temperature_offset_c + generator.normal(0.0, sensors.temperature_noise_c, len(time_s))
    columns[LOGGER_COLUMNS[4]] = _converted(seen_c, sensors.temperature_span_c, sensors.bits, 0.0)
    if load_cell:
        rows = np.arange(len(trace)) - round(sensors.load_delay_s / log_step_s)
        true_n = trace["load_force_n"].to_numpy()[np.maximum(rows, 0)]
        seen_n = sampled(_anti_alias(true_n, log_step_s, sensors.anti_alias_hz)) * sensors.load_gain
        seen_n += sensors.load_offset_n + generator.normal(0.0, sensors.load_noise_n, len(time_s))
        columns[LOAD_COLUMN] = _converted(seen_n, sensors.load_span_n, sensors.bits - 1, -sensors.load_span_n)
    return pd.DataFrame(columns)


def at_ports(trace: pd.DataFrame, hydraulics: HydraulicParameters) -> pd.DataFrame:
    """Replace a trace's chamber pressures by those in the ports, behind the cushions that oil leaves through."""
    step_s = float(trace["time_s"].iloc[1] - trace["time_s"].iloc[0])
    position_m = trace["position_m"].to_numpy()
    seen = {}
    for side, distance_m in (("1", position_m), ("2", hydraulics.stroke_m - position_m)):
        part = np.clip(distance_m / hydraulics.cushion_length_m, 0.0, 1.0)
        closing = hydraulics.cushion_open_gain - hydraulics.cushion_closed_gain
        gain = hydraulics.cushion_closed_gain + closing * part**2
        out_m3_s = np.maximum(-np.gradient(trace[f"volume_{side}_m3"].to_numpy(), step_s), 0.0) * (part < 1.0)
        chamber_pa = trace[f"pressure_{side}_pa"].to_numpy()
        most_pa = np.maximum(chamber_pa - hydraulics.tank_pressure_pa, 0.0)
        seen[f"pressure_{side}_pa"] = chamber_pa - np.minimum((out_m3_s / gain) ** 2, most_pa)
    return trace.assign(**seen)


def as_written(table: pd.DataFrame) -> pd.DataFrame:
    """Round a logger's table to the ``DECIMALS`` of its file, so that it equals the table read back from the file.

    Use it to work on a simulated recording without writing it: the numbers are the same bits. Columns stay as they are,
    in seconds, bar, millimetres, degrees Celsius and newtons.
    """
    columns = {}
    for name in table.columns:
        # A converter gives few distinct values, so only these are formatted; binary rounding would differ at ties.
        values, place = np.unique(table[name].to_numpy(), return_inverse=True)
        columns[name] = np.array([float(f"{value:.{DECIMALS}f}") for value in values])[place]
    return pd.DataFrame(columns)


def write_logger_csv(path: Path, table: pd.DataFrame) -> None:
    """Write a table as the logger does, each number with ``DECIMALS`` decimals."""
    table.to_csv(path, index=False, float_format=f"%.{DECIMALS}f", lineterminator="\n")


def _transmitted(sensors: SensorParameters, trace: pd.DataFrame, side: int, log_step_s: float) -> Array:
    """Compute the pressure that a transmitter follows [Pa]: its chamber's pressure plus, at a valve, the line's loss.

    Oil that flows into the chamber makes the pressure at the valve higher than the chamber's, oil that flows out lower.
    """
    pressure_pa = trace[f"pressure_{side + 1}_pa"].to_numpy()
    if sensors.line_laminar_pa_s_m3 or sensors.line_turbulent_pa_s2_m6:
        flow_m3_s = np.gradient(trace[f"volume_{side + 1}_m3"].to_numpy(), log_step_s)
        turbulent = sensors.line_turbulent_pa_s2_m6 * np.abs(flow_m3_s)
        pressure_pa = pressure_pa + (sensors.line_laminar_pa_s_m3 + turbulent) * flow_m3_s
    return _late(pressure_pa, sensors.pressure_lag_s, log_step_s) if sensors.pressure_lag_s else pressure_pa


def _late(values: Array, lag_s: float, step_s: float) -> Array:
    """Pass values through a first-order lag, in its steady state at the first value."""
    keep = np.exp(-step_s / lag_s)
    late, _ = signal.lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])
    return np.asarray(late)


def _potentiometer(sensors: SensorParameters, position_m: Array) -> Array:
    """Compute the wiper's reading: the backlash of the coupling, then the linearity error of the resistive element."""
    wiper_m = np.asarray(_backlash(position_m, sensors.backlash_m))
    angle = np.pi * wiper_m / sensors.position_span_m
    first, second = sensors.linearity_m
    return np.asarray(wiper_m + first * np.sin(angle) + second * np.sin(2.0 * angle))


@numba.njit(cache=True)
def _backlash(position_m: Any, backlash_m: float) -> Any:
    wiper = np.empty_like(position_m)
    at = position_m[0]
    for index in range(len(position_m)):
        at = min(max(at, position_m[index] - 0.5 * backlash_m), position_m[index] + 0.5 * backlash_m)
        wiper[index] = at
    return wiper


def _anti_alias(values: Array, step_s: float, corner_hz: float) -> Array:
    """Pass values through a second-order Butterworth low-pass, in its steady state at the first value."""
    sections = signal.butter(2, corner_hz, fs=1.0 / step_s, output="sos")
    start = signal.sosfilt_zi(sections) * values[0]
    filtered, _ = signal.sosfilt(sections, values, zi=start)
    return np.asarray(filtered)


def _converted(values: Array, span: float, bits: int, lowest: float) -> Array:
    step = span / 2**bits
    return np.asarray(np.round(np.clip(values, lowest, span) / step) * step)
