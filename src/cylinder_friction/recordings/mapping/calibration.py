"""Zeros of the pressure sensors, from a stretch in which both chambers are vented, and the uncertainty left after it.

A sensor's stated accuracy is as large as the friction it is to show: ±0.5 % of 250 bar on a piston of 63 mm is ±390 N.
Most of it is an offset that stays the same for hours, and a vented chamber shows it: its gauge pressure is zero.

Standstill alone does not. A cylinder that stands with closed ports holds P1·A1 - P2·A2 anywhere within ± its break-away
friction, so a zero taken there would hide up to that much force, and friction is what the label is to find. Nor does
the position sensor's zero follow from anything here; its mapping's ``offset`` states it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import PRESSURES, TIME
from cylinder_friction.recordings.mapping.channel_mapping import (
    HALF_WIDTH_TO_STANDARD,
    ChannelMapping,
    sensor_step,
    sensor_uncertainty,
)
from cylinder_friction.recordings.mapping.units import column_scale
from cylinder_friction.recordings.recording import Columns, RecordingError, RecordingMetadata, expect

NOT_CORRECTED = "zeros of the pressure sensors not corrected"

FEWEST_BLOCKS = 8  # means of fewer blocks scatter too little or too much to be meaningful


def longest_steady(signals: Array, spans: Array, bounds: Array) -> tuple[int, int]:
    """Return the first row and the row after the last of the longest stretch in which every signal is steady.

    Of stretches of equal length the first; (0, 0) if there is none. A part of a steady stretch is steady too, so the
    length is found by bisection.

    Args:
        signals: One column per signal, shape ``(n, m)``; a NaN ends a stretch.
        spans: Within a stretch a signal's largest and smallest value differ by no more than this, shape ``(m,)``.
        bounds: Within a stretch no value is further from zero than this, shape ``(m,)``.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d  # Only logs with a zero to be found need it

    values = np.where(np.all(np.abs(signals) <= bounds, axis=1, keepdims=True), signals, np.inf)

    def starts(length: int) -> NDArray[np.intp]:
        windows = slice(length // 2, length // 2 + len(values) - length + 1)
        with np.errstate(invalid="ignore"):
            span = (maximum_filter1d(values, length, axis=0) - minimum_filter1d(values, length, axis=0))[windows]
        return np.flatnonzero((span <= spans).all(axis=1))

    longest, too_long = 0, len(values) + 1
    while too_long - longest > 1:
        length = (longest + too_long) // 2
        longest, too_long = (length, too_long) if len(starts(length)) else (longest, length)
    first = int(starts(longest)[0]) if longest else 0
    return first, first + longest


def averaged(signals: Array, half: int) -> Array:
    """Return the centred moving average over ``2·half + 1`` rows, fewer towards the ends, shape ``(n, m)``."""
    return pd.DataFrame(signals).rolling(2 * half + 1, center=True, min_periods=1).mean().to_numpy()


def mean_uncertainty(values: Array) -> float:
    """Return the standard uncertainty of the mean of samples that may depend on each other, shape ``(n,)``.

    Neighbours are averaged in pairs again and again; σ/√n of the blocks grows until they are independent of each other,
    and its largest value is taken, down to 8 blocks (Flyvbjerg & Petersen 1989, J. Chem. Phys. 91, 461). A slow drift
    counts too: the largest blocks show it.
    """
    blocks = np.asarray(values, dtype=np.float64) - values[0]
    largest = 0.0
    while len(blocks) >= FEWEST_BLOCKS:
        largest = max(largest, float(np.std(blocks, ddof=1)) / len(blocks) ** 0.5)
        even = len(blocks) // 2 * 2
        blocks = 0.5 * (blocks[0:even:2] + blocks[1:even:2])
    return largest


ZeroMethod = Literal["none", "window", "found"]

AVERAGED_S = 0.1
"""Noise is averaged over so long before a signal is called steady: the extremes
of raw noise grow with the length of the stretch, and a position sensor of ±0.1 mm would never stand still."""


@dataclass(frozen=True)
class ZeroRules:
    """How the zeros of the pressure sensors are found."""

    # ``none`` leaves pressures as they are; ``window`` takes a stated stretch of every recording in which both chambers
    # are vented; ``found`` looks for the longest stretch that may be one
    method: ZeroMethod = "none"
    window_s: tuple[float, float] | None = None  # From and to, of the recording's time [s]; for ``window``
    band_pa: float = 3e5  # A vented sensor reads less than this either way [Pa]
    # Within a vented stretch a pressure stays within this, noise averaged over ``AVERAGED_S`` [Pa]
    steady_pa: float = 0.5e5
    still_m: float = 5e-4  # Within a vented stretch the position stays within this, averaged alike [m]
    minimum_s: float = 2.0  # A shorter stretch is none [s]
    # A zero further off than this many times the sensor's accuracy is trapped pressure, or a broken sensor; if the
    # accuracy is not stated, the band alone decides
    accuracy_factor: float = 2.0

    def __post_init__(self) -> None:
        window_s = self.window_s
        expect(self.method in get_args(ZeroMethod), "zero: method", f"one of {get_args(ZeroMethod)}", self.method)
        if self.method != "window":
            expect(window_s is None, "zero: window_s", f"none with method {self.method}", window_s)
        else:
            valid = window_s is not None and -math.inf < window_s[0] < window_s[1] < math.inf
            expect(valid, "zero: window_s", "two times with method window, the first earlier", window_s)
        for name in ("band_pa", "steady_pa", "still_m", "minimum_s", "accuracy_factor"):
            value = getattr(self, name)
            expect(0.0 < value < math.inf, f"zero: {name}", "a positive number", value)


@dataclass(frozen=True)
class ZeroReading:
    """What vented sensors read; nothing, if there are no offsets."""

    # Mean reading by column, in the column's unit
    offsets: Mapping[str, float] = field(default_factory=dict)
    # Standard uncertainty of each, autocorrelation and converter steps accounted for
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    # from_s, to_s: Start and end of the stretch [s]
    from_s: float = 0.0
    to_s: float = 0.0
    recording: str = ""  # Name of the recording in which it was read
    reason: str = ""  # Why nothing was read, in a sentence; empty if nobody asked for a zero


def find_zero(
    table: Columns, rules: ZeroRules, mapping: Mapping[str, ChannelMapping], recording: str = ""
) -> ZeroReading:
    """Return what the pressure sensors read while their chambers were vented, or why there is no zero.

    Args:
        table: Of a recording or piece, in SI units, at one constant rate, shape ``(n, columns)``.

    Raises:
        RecordingError: In the stated window the chambers were not vented: something moves, or a pressure changes, or
            is further from zero than the sensor's accuracy explains.
    """
    if rules.method == "none":
        return ZeroReading()
    columns = [column for column in PRESSURES if column in table]
    if not columns:
        return _none("there is no pressure column")
    time_s = np.asarray(table[TIME], dtype=np.float64)
    step_s = float(time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1)
    half = round(0.5 * AVERAGED_S / step_s) if step_s > 0.0 else 0
    signals = np.column_stack([np.asarray(table[column], dtype=np.float64) for column in ("position_m", *columns)])
    if rules.window_s is not None:
        first, end = (int(row) for row in np.searchsorted(time_s, rules.window_s))
    else:
        spans = np.array([rules.still_m, *[rules.steady_pa] * len(columns)])
        bounds = np.array([np.inf, *[_largest_zero(column, rules, mapping) + rules.steady_pa for column in columns]])
        first, end = longest_steady(averaged(signals, half), spans, bounds)
    from_s, to_s = rules.window_s or (0.0, math.inf)
    length_s, least_s = (end - first) * step_s, min(rules.minimum_s, to_s - from_s)
    if length_s < least_s - 0.5 * step_s:
        if rules.window_s is None:
            found, ending = "the longest stretch that may be vented lasts", "with both pressures steady near zero"
            return _none(f"{found} {length_s:.3g} s, expected {least_s:g} s at standstill {ending}")
        window = f"the window from {from_s:g} to {to_s:g} s"
        return _none(f"{window} holds {length_s:.3g} s of this recording, expected {least_s:g} s")
    problem = _not_vented(averaged(signals[first:end], half), columns, rules, mapping)
    if problem:
        where = f"from {time_s[first]:.4g} to {time_s[end - 1]:.4g} s"
        if rules.method == "window":
            raise RecordingError(
                f"{problem} {where}, the stated window; expected both chambers vented there; correct "
                "zero.window_s in the mapping, or vent the cylinder at the start of a log"
            )
        return _none(f"{problem} {where}, the longest steady stretch")
    readings = {column: signals[first:end, index] for index, column in enumerate(columns, start=1)}
    return ZeroReading(
        offsets={column: float(np.mean(reading)) for column, reading in readings.items()},
        uncertainty={column: _zero_uncertainty(column, reading, mapping) for column, reading in readings.items()},
        from_s=float(time_s[first]),
        to_s=float(time_s[end - 1]),
        recording=recording,
    )


def _none(why: str) -> ZeroReading:
    return ZeroReading(reason=f"{NOT_CORRECTED}: {why}")


def session_zero(readings: Sequence[ZeroReading]) -> ZeroReading:
    """Return the zero that holds for the other recordings of a session, from those that show one.

    Offsets are averaged; their uncertainty holds the readings' own and their scatter from recording to recording, for
    a zero that wanders between two readings wanders elsewhere too. One reading passes as it is.
    """
    read = [reading for reading in readings if reading.offsets]
    if len(read) < 2:
        return read[0] if read else _none("none read in this session")
    offsets: dict[str, float] = {}
    uncertainty: dict[str, float] = {}
    for column in read[0].offsets:
        if all(column in reading.offsets for reading in read):
            values = np.array([reading.offsets[column] for reading in read])
            own = np.array([reading.uncertainty[column] for reading in read])
            offsets[column] = float(values.mean())
            uncertainty[column] = math.sqrt(float(np.mean(own**2) + np.var(values, ddof=1)))
    names = ", ".join(reading.recording for reading in read)
    return replace(read[0], offsets=offsets, uncertainty=uncertainty, recording=names)


def apply_zero(
    table: Columns,
    metadata: RecordingMetadata,
    reading: ZeroReading,
    mapping: Mapping[str, ChannelMapping],
) -> tuple[Columns, RecordingMetadata]:
    """Return a recording's table with its pressure zeros taken off, and its metadata with what is then uncertain.

    Without a reading the table is returned as it is, and the sensors' stated accuracy stands in full. A sensor whose
    accuracy is not stated gets no uncertainty, zeroed or not: its span is not known.
    """
    uncertainty = {column: stated for column, stated in sensor_uncertainty(mapping).items() if column in table}
    offsets = {column: offset for column, offset in reading.offsets.items() if column in table}
    reasons = [reading.reason] if reading.reason else []
    if reading.offsets:
        reasons = [_sentence(reading, offsets, metadata.name)]
        table = {**table, **{column: table[column] - offset for column, offset in offsets.items()}}
        for column in offsets.keys() & uncertainty.keys():
            sensor = mapping[column].sensor
            assert sensor is not None
            assert sensor.accuracy_percent is not None
            # What is left of the accuracy grows with the reading and reaches a·FS / √3 at full scale.
            span = sensor.accuracy_percent / 100.0 * HALF_WIDTH_TO_STANDARD
            uncertainty[column] = replace(uncertainty[column], zero=reading.uncertainty[column], span=span)
    return table, replace(
        metadata,
        zero_offset={**metadata.zero_offset, **offsets},
        uncertainty={**metadata.uncertainty, **uncertainty},
        repairs=(*metadata.repairs, *reasons),
    )


def _sentence(reading: ZeroReading, offsets: Mapping[str, float], recording: str) -> str:
    taken = ", ".join(
        f"{column} {offset / 1e5:+.4f} bar (± {2.0 * reading.uncertainty[column] / 1e5:.4f})"
        for column, offset in offsets.items()
    )
    other = f" of {reading.recording}" if reading.recording not in ("", recording) else ""
    when = f"from {reading.from_s:.4g} to {reading.to_s:.4g} s{other}"
    return f"zeros taken off: {taken}, as read with vented chambers {when}"


def _largest_zero(column: str, rules: ZeroRules, mapping: Mapping[str, ChannelMapping]) -> float:
    """Return how far from zero a vented sensor may read [Pa]."""
    sensor = mapping[column].sensor if column in mapping else None
    if sensor is None or sensor.accuracy_percent is None:
        return rules.band_pa
    accuracy_pa = sensor.accuracy_percent / 100.0 * sensor.full_scale * column_scale(column, sensor.unit)
    return min(rules.band_pa, rules.accuracy_factor * accuracy_pa)


def _not_vented(signals: Array, columns: Sequence[str], rules: ZeroRules, mapping: Mapping[str, ChannelMapping]) -> str:
    """Return what speaks against vented chambers; empty if nothing does."""
    moved_m = float(np.ptp(signals[:, 0]))
    if not moved_m <= rules.still_m:
        return f"position_m changes by {moved_m * 1e3:.3g} mm"
    for index, column in enumerate(columns, start=1):
        changed_pa, mean_pa = float(np.ptp(signals[:, index])), float(np.mean(signals[:, index]))
        if not changed_pa <= rules.steady_pa:
            return f"{column} changes by {changed_pa / 1e5:.3g} bar"
        largest_pa = _largest_zero(column, rules, mapping)
        if abs(mean_pa) > largest_pa:
            return f"{column} reads {mean_pa / 1e5:.3g} bar, a zero may be off by {largest_pa / 1e5:.3g} bar at most,"
    return ""


def _zero_uncertainty(column: str, reading: Array, mapping: Mapping[str, ChannelMapping]) -> float:
    """Return the standard uncertainty of a mean reading; one that stands on a step hides up to half of it."""
    uncertainty, source = mean_uncertainty(reading), mapping.get(column)
    step = sensor_step(column, source.sensor, source.unit) if source is not None and source.sensor else None
    on_one_step = step is not None and float(np.std(reading)) <= 0.5 * step
    return math.hypot(uncertainty, (step or 0.0) / math.sqrt(12.0)) if on_one_step else uncertainty
