"""The sensor behind a channel: what it can read, how fine, how sure, and what its electrical signal means."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.mapping.units import column_scale, electrical
from cylinder_friction.recordings.recording import RecordingError

HALF_WIDTH_TO_STANDARD = 1.0 / math.sqrt(3.0)
"""From the half-width of a rectangular distribution to its standard deviation (JCGM 100:2008, 4.3.7)."""


@dataclass(frozen=True)
class SensorScale:
    """A sensor as its data sheet states it."""

    # What it reads at the two ends of its signal, in ``unit``; the first may be the larger one
    range: tuple[float, float]
    unit: str  # Of ``range``, for example bar
    # What the channel holds at the two ends of ``range``, in the channel's own unit: (4, 20) mA, (0, 10) V, (0, 4095)
    # counts. None where the logger has done that sum already.
    signal: tuple[float, float] | None = None
    bits: int | None = None  # Of the converter that spreads ``range`` over 2^bits steps, if known
    accuracy_percent: float | None = None  # Stated accuracy, ± percent of full scale, if known
    # Standard uncertainty (k = 1) of the zero, in ``unit``, where a calibration states it; it takes the accuracy's
    # place for the zero, and the accuracy then holds for the span alone
    zero_uncertainty: float | None = None
    # How late its signal is, for example by the filter of its amplifier [s]; taken off its time stamps
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        for field in ("range", "signal"):
            pair = getattr(self, field)
            if pair is not None and not (len(pair) == 2 and all(map(math.isfinite, pair)) and pair[0] != pair[1]):
                raise RecordingError(f"sensor: {field} must be two different finite numbers, but got {pair!r}")
        if self.bits is not None and not 1 <= self.bits <= 32:
            raise RecordingError(f"sensor: bits must be 1 to 32, but got {self.bits!r}")
        if self.accuracy_percent is not None and not 0.0 <= self.accuracy_percent <= 100.0:
            raise RecordingError(
                f"sensor: accuracy_percent must be 0 to 100 (of full scale), but got {self.accuracy_percent!r}"
            )
        if self.zero_uncertainty is not None and not 0.0 <= self.zero_uncertainty < math.inf:
            raise RecordingError(f"sensor: zero_uncertainty must not be negative, but got {self.zero_uncertainty!r}")
        if not 0.0 <= self.delay_s < math.inf:
            raise RecordingError(f"sensor: delay_s must not be negative, but got {self.delay_s!r}")
        if self.zero_uncertainty is not None and self.accuracy_percent is None:
            raise RecordingError("sensor: zero_uncertainty needs accuracy_percent beside it, which holds for the span")

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Return the sensor of a dictionary, for example out of YAML, where pairs are lists."""
        pairs = {key: tuple(values[key]) for key in ("range", "signal") if values.get(key) is not None}
        return cls(**{**values, **pairs})

    @property
    def full_scale(self) -> float:
        """Extent of the range, in ``unit``."""
        return abs(self.range[1] - self.range[0])

    def reading(self, signal: Array) -> Array:
        """Return what the sensor reads, in ``unit``, from its electrical signal: linear, and beyond the ends too.

        The signal itself is returned where the logger has done that sum already.
        """
        if self.signal is None:
            return signal
        (low, high), (first, last) = self.range, self.signal
        return low + (signal - first) * ((high - low) / (last - first))


@dataclass(frozen=True)
class SensorLimits:
    """What a sensor can read, in the column's unit."""

    low: float
    high: float
    step: float | None  # One step of its converter; None if not known
    described: str  # The range as the logger's user knows it, for messages: ``0 to 250 bar (4 to 20 mA)``


def sensor_step(column: str, sensor: SensorScale, channel_unit: str = "") -> float | None:
    """Return one step of the converter in the column's unit: one count, or the range over 2^bits; None if unknown."""
    if sensor.signal is not None and electrical(channel_unit) == "count":
        steps = abs(sensor.signal[1] - sensor.signal[0])
    elif sensor.bits is not None:
        steps = 2.0**sensor.bits
    else:
        return None
    return sensor.full_scale * column_scale(column, sensor.unit) / steps
