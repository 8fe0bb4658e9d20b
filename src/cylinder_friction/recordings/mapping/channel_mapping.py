"""Map a logger's channels to the columns of a recording, with unit, sensor, sign and offset."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import ONE_CHAMBER
from cylinder_friction.recordings.columns import PRESSURE_2, PRESSURES, QUANTITIES, TIME
from cylinder_friction.recordings.line_loss import RECTANGULAR, LineLoss
from cylinder_friction.recordings.mapping import units
from cylinder_friction.recordings.recording import RecordingError, SensorUncertainty, expect, missing_columns


@dataclass(frozen=True)
class SensorScale:
    """A sensor as its data sheet states it."""

    # Readings at the two ends of its signal, in ``unit``; the first may be the larger one
    range: tuple[float, float]
    unit: str  # Unit of ``range``, for example bar
    # Values of the channel at the two ends of ``range``, in the channel's own unit: (4, 20) mA, (0, 10) V, (0, 4095)
    # counts. None if the logger has already converted the signal.
    signal: tuple[float, float] | None = None
    bits: int | None = None  # Resolution of the converter, which divides ``range`` into 2^bits steps, if known
    accuracy_percent: float | None = None  # Stated accuracy [± % of full scale], if known
    # Standard uncertainty (k = 1) of the zero, in ``unit``, if a calibration states it. The accuracy then applies to
    # the span alone
    zero_uncertainty: float | None = None
    # Delay of its signal, for example by the filter of its amplifier [s]; subtracted from its time stamps
    delay_s: float = 0.0
    line_loss: LineLoss | None = None  # Pressure loss in the line to a pressure sensor away from the cylinder
    serial: str = ""  # Serial number
    calibrated: str = ""  # Day of its last calibration, such as 2026-03-27

    def __post_init__(self) -> None:
        for name in ("range", "signal"):
            pair = getattr(self, name)
            valid = pair is None or (len(pair) == 2 and all(map(math.isfinite, pair)) and pair[0] != pair[1])
            expect(valid, f"sensor: {name}", "two different finite numbers", pair)
        accuracy, zero = self.accuracy_percent, self.zero_uncertainty
        expect(self.bits is None or 1 <= self.bits <= 32, "sensor: bits", "1 to 32", self.bits)
        known = accuracy is None or 0.0 <= accuracy <= 100.0
        expect(known, "sensor: accuracy_percent", "0 to 100 (of full scale)", accuracy)
        expect(zero is None or 0.0 <= zero < math.inf, "sensor: zero_uncertainty", "zero or a positive number", zero)
        expect(0.0 <= self.delay_s < math.inf, "sensor: delay_s", "zero or a positive number", self.delay_s)
        if zero is not None and accuracy is None:
            raise RecordingError("sensor: zero_uncertainty needs accuracy_percent beside it, which holds for the span")

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Make the sensor from a dictionary, for example from YAML, in which pairs are lists."""
        pairs = {key: tuple(values[key]) for key in ("range", "signal") if values.get(key) is not None}
        texts = {key: str(values[key]) for key in ("serial", "calibrated") if values.get(key) is not None}
        line = {} if values.get("line_loss") is None else {"line_loss": LineLoss(**values["line_loss"])}
        return cls(**{**values, **pairs, **texts, **line})

    @property
    def identity(self) -> dict[str, str]:
        """Serial number and day of calibration, if stated."""
        stated = {"serial": self.serial, "calibrated": self.calibrated}
        return {name: value for name, value in stated.items() if value}

    @property
    def full_scale(self) -> float:
        """Span of the range, in ``unit``."""
        return abs(self.range[1] - self.range[0])

    def reading(self, signal: Array) -> Array:
        """Convert the signal to readings in ``unit``: linearly, also beyond the ends.

        If the logger has already converted the signal, it is returned unchanged.
        """
        if self.signal is None:
            return signal
        (low, high), (first, last) = self.range, self.signal
        return low + (signal - first) * ((high - low) / (last - first))


@dataclass(frozen=True)
class SensorLimits:
    """Limits of a sensor's readings, in the column's unit."""

    low: float
    high: float
    step: float | None  # Step of its converter; None if not known
    described: str  # The range as the user states it, for messages: ``0 to 250 bar (4 to 20 mA)``


STANDARD_ATMOSPHERE_PA = 101325.0
"""Absolute less gauge pressure [Pa] (ISO 2533). The weather's ±3 kPa remain as an error of the zero."""


@dataclass(frozen=True)
class ChannelMapping:
    """The source of one column of a recording.

    The column is sign · (x - offset), where x is the sensor's reading in its unit. The result is converted to the
    column's unit. One standard atmosphere is subtracted from absolute pressures.
    """

    channel: str = ""  # The logger's name of the channel; empty only for ``time_s`` if ``rate_hz`` is given
    # Unit of the logged values: a unit of the column's quantity, or V, mA or count with a ``sensor``. Empty only for a
    # time channel with dates.
    unit: str = ""
    sign: int = 1  # -1 if the sensor is mounted backwards, so that extension and the force driving it are positive
    table: str = ""  # Name of the file's table with the channel; needed if several tables have a channel of this name
    # Time channel of this channel, if tables have their own ones; by default the channel of ``time_s`` in the same
    # table
    time: str = ""
    time_unit: str = ""  # Unit of that time channel, if the file does not state it
    sensor: SensorScale | None = None  # Scale and limits of the sensor
    # Reading at which the column is zero, in the sensor's unit; for a position sensor the reading with the rod
    # retracted
    offset: float = 0.0
    # Rate of the rows in place of a time channel, only for ``time_s`` [Hz]; the first row is at 0 s
    rate_hz: float | None = None
    # Names of the channel in other files of the same logger. If ``channel`` is missing, the first name found is used
    alternatives: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        where = f"channel {self.channel!r}"
        expect(self.channel or self.rate_hz is not None, "channel", "the logger's name of the channel", self.channel)
        rated = self.rate_hz is None or (not self.channel and 0.0 < self.rate_hz < math.inf)
        expect(rated, f"{where}: rate_hz", "a positive number in place of a channel", self.rate_hz)
        expect(self.sign in (1, -1), f"{where}: sign", "1 or -1", self.sign)
        expect(math.isfinite(self.offset), f"{where}: offset", "a finite number", self.offset)
        scaled = self.sensor is not None and self.sensor.signal is not None
        if units.electrical(self.unit) not in (None, "%") and not scaled:
            raise RecordingError(
                f"{where}: unit {self.unit!r} is a sensor's signal and means nothing without its range; "
                "state the sensor: {range: [low, high], unit: ..., signal: [low, high]}"
            )
        if scaled and units.electrical(self.unit) is None:
            raise RecordingError(
                f"{where}: unit {self.unit!r} is what the sensor reads already, but its signal is stated too; expected "
                "V, mA or count as the channel's unit, or a sensor without signal"
            )

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Make the mapping from a nested dictionary, for example from YAML."""
        sensor = values.get("sensor")
        others = values.get("alternatives") or ()
        if isinstance(others, str):
            raise RecordingError(f"alternatives: got {others!r}, expected a list of names, such as [{others}]")
        made = {"sensor": None if sensor is None else SensorScale.from_dict(sensor), "alternatives": tuple(others)}
        return cls(**{**values, **made})

    def for_stroke(self, column: str, stroke_m: float) -> Self:
        """Add a sensor if the channel is a percentage of the stroke; return any other mapping unchanged."""
        if self.sensor is not None or not units.of_stroke(column, self.unit):
            return self
        return replace(self, sensor=SensorScale((0.0, stroke_m), "m", signal=(0.0, 100.0)))

    @property
    def names(self) -> tuple[str, ...]:
        """All names that the channel may have, the usual one first."""
        return tuple(filter(None, (self.channel, *self.alternatives)))

    @property
    def reading_unit(self) -> str:
        """Unit of the sensor's readings after its electrical signal has been converted."""
        return self.sensor.unit if self.sensor is not None and self.sensor.signal is not None else self.unit

    @property
    def absolute(self) -> bool:
        """Whether the channel is an absolute pressure."""
        return units.stated_reference(self.reading_unit) == "absolute"

    def column_values(self, raw: Array, column: str) -> Array:
        """Convert a channel's cells to the column's values; return the array itself if nothing changes."""
        reading = raw if self.sensor is None else self.sensor.reading(raw)
        zeroed = reading if self.offset == 0.0 else reading - self.offset
        return self.counted(units.to_column_unit(zeroed, self.reading_unit, column))

    def counted(self, values: Array) -> Array:
        """Apply the sign to values in the column's unit, and subtract the atmosphere from absolute pressures."""
        signed = values if self.sign == 1 else -values
        return signed - STANDARD_ATMOSPHERE_PA if self.absolute else signed


def check_mapping(mapping: Mapping[str, ChannelMapping]) -> None:
    """Refuse a mapping that cannot make a recording from any file.

    Raises:
        RecordingError: A column is unknown or a required one is not mapped, a unit does not fit, or one channel fills
            two columns.
    """
    for column in mapping:
        if column not in QUANTITIES:
            raise RecordingError(f"column {column!r} is not known; expected some of {', '.join(QUANTITIES)}")
    if missing := missing_columns(mapping):
        why = f" ({ONE_CHAMBER})" if missing[0] == PRESSURE_2 else ""
        raise RecordingError(f"column {missing[0]!r} has no channel; name the logger's channel that holds it{why}")
    for column, source in mapping.items():
        if problem := _problem(column, source):
            raise RecordingError(f"column {column!r}: {problem}")
    for (user, other), (column, source) in itertools.combinations(mapping.items(), 2):
        shared = sorted({*other.names} & {*source.names})
        if shared and (other.table == source.table or not (other.table and source.table)):
            raise RecordingError(
                f"channel {shared[0]!r} is to fill both {user!r} and {column!r}; expected one column per channel"
            )


def _problem(column: str, source: ChannelMapping) -> str:
    """State a contradiction in a column's mapping; empty if there is none. A unit that does not fit is refused."""
    sensor = source.sensor
    if column == TIME:
        if source.unit:
            units.check_unit(column, source.unit)
        meaningless = source.sign != 1 or sensor is not None or source.time or source.time_unit
        return "sign, sensor and time have no meaning for time; leave them out" if meaningless else ""
    if source.time_unit:
        units.check_unit(TIME, source.time_unit)
    if source.rate_hz is not None:
        return f"rate_hz is for {TIME!r} alone; name the channel"
    if sensor is None and units.of_stroke(column, source.unit):
        return ""
    units.check_unit(column, source.reading_unit)
    if sensor is not None:
        units.check_unit(column, sensor.unit)
        if not source.absolute and units.stated_reference(sensor.unit) == "absolute":
            return (
                f"the sensor's unit {sensor.unit!r} is absolute pressure, but the channel is read as gauge; write "
                "its unit as absolute too, such as bara, or give the range in gauge pressure"
            )
        if sensor.line_loss is not None and column not in PRESSURES:
            return "sensor.line_loss is for the cylinder's pressures alone; leave it out"
    return ""


def wanted_channels(mapping: Mapping[str, ChannelMapping]) -> set[str]:
    """List the names of all channels that a mapping reads, time channels included."""
    return {name for source in mapping.values() for name in (*source.names, source.time) if name}


def sensor_limits(mapping: Mapping[str, ChannelMapping]) -> dict[str, SensorLimits]:
    """Compute the limits of each stated sensor by column, with unit, offset, atmosphere and sign applied."""
    limits = {}
    for column, source in mapping.items():
        sensor = source.sensor
        if sensor is None:
            continue
        offset = source.offset * units.column_scale(column, source.reading_unit)
        ends = source.counted(
            units.to_column_unit(np.array(sensor.range, dtype=np.float64), sensor.unit, column) - offset
        )
        step = sensor_step(column, sensor, source.unit)
        described = f"{min(sensor.range):g} to {max(sensor.range):g} {sensor.unit}"
        if sensor.signal is not None:
            described += f" ({min(sensor.signal):g} to {max(sensor.signal):g} {source.unit})"
        limits[column] = SensorLimits(float(ends.min()), float(ends.max()), step, described)
    return limits


def sensor_uncertainty(mapping: Mapping[str, ChannelMapping]) -> dict[str, SensorUncertainty]:
    """Compute the standard uncertainty of each sensor with a stated accuracy, by column, before any zeroing.

    A stated accuracy of ± a % of full scale only bounds the error, so that all errors within it are equally likely:
    u = a·FS / √3 (JCGM 100:2008, GUM, 4.3.7). It counts as an error of the zero, because it is constant in a recording
    and possible at any reading. No error of the span is added, because the accuracy covers both together.
    """
    stated = {}
    for column, source in mapping.items():
        sensor = source.sensor
        if sensor is None or sensor.accuracy_percent is None:
            continue
        resolution = sensor_step(column, sensor, source.unit) or 0.0
        share = sensor.accuracy_percent / 100.0 * RECTANGULAR
        scale = units.column_scale(column, sensor.unit)
        if sensor.zero_uncertainty is None:
            stated[column] = SensorUncertainty(share * sensor.full_scale * scale, 0.0, resolution)
        else:
            stated[column] = SensorUncertainty(sensor.zero_uncertainty * scale, share, resolution)
    return stated


def sensor_step(column: str, sensor: SensorScale, channel_unit: str = "") -> float | None:
    """Compute the converter's step in the column's unit: one count, or the range over 2^bits; None if not known."""
    if sensor.signal is not None and units.electrical(channel_unit) == "count":
        steps = abs(sensor.signal[1] - sensor.signal[0])
    elif sensor.bits is not None:
        steps = 2.0**sensor.bits
    else:
        return None
    return sensor.full_scale * units.column_scale(column, sensor.unit) / steps
