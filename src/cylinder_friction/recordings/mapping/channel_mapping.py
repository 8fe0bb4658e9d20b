"""Map a logger's channels to the columns of a recording, with unit, sensor, sign and offset.

Loggers' units (``[Bar]``, ``degC``, ``kp/cm²``, ``barg``) are converted to SI units, gauge pressure and °C.
"""

import itertools
import math
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import ONE_CHAMBER
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.columns import POSITION, PRESSURE_2, PRESSURES, QUANTITIES, TIME
from cylinder_friction.recordings.line_loss import RECTANGULAR, LineLoss
from cylinder_friction.recordings.recording import RecordingError, SensorUncertainty, expect, missing_columns

NOT_FOUND = "NOT FOUND"
"""Placeholder for a channel's name that the user must fill in; ingest refuses it and lists the file's channels."""
ANOTHER_UNIT = "another unit"  # Stands among the units that a count without one may have
STANDARD_ATMOSPHERE_PA = 101325.0
"""Absolute less gauge pressure [Pa] (ISO 2533). The weather's ±3 kPa remain as an error of the zero."""

_SPELLINGS: dict[str, dict[float | tuple[float, float], str]] = {
    "time": {
        1.0: "s | sec secs second seconds sek sekunde sekunden 秒 с",
        1e-3: "ms | msec msecs millis millisec millisecs millisecond milliseconds millisekunden millitm 毫秒 мс",
        1e-6: "us | μs usec usecs micros microsec microsecs microsecond microseconds mikrosekunden",
        1e-9: "ns | nsec nsecs nanos nanosec nanosecs nanosecond nanoseconds nanosekunden",
        1e-7: "100ns | ticks", 60.0: "min | minute minutes minuten", 3600.0: "h | hr hour hours std",
        86400.0: "d | day",
    },
    "pressure": {
        1.0: "Pa | N/m2", 1e3: "kPa | kN/m2", 1e6: "MPa N/mm2 | 兆帕 МПа", 1e5: "bar | бар", 1e2: "mbar hPa",
        6894.757293168362: "psi | lbf/in2 lb/in2", 6894757.293168361: "ksi",
        98066.5: "kgf/cm2 | kg/cm2 kp/cm2 at", 101325.0: "atm",
    },
    "length": {
        1.0: "m | meter metre", 1e-3: "mm | 毫米 мм", 1e-2: "cm", 1e-6: "um | μm micron",
        0.0254: "in | inch inches zoll", 0.3048: "ft", 2.54e-5: "mil | thou",
    },
    # A load cell may display the mass that hangs on it; the force is its weight.
    "force": {
        1.0: "N | newton", 1e-6: "uN | μN", 10.0: "daN", 1e3: "kN",
        4.4482216152605: "lbf | lb lbs", 4448.2216152605: "kip | kips",
        9.80665: "kgf | kp kg", 9806.65: "t | tf",
    },
    "temperature": {
        1.0: "°C | degC gradC C celsius", (1.0, -273.15): "K | kelvin",
        (5.0 / 9.0, -160.0 / 9.0): "°F | degF F fahrenheit",
    },
}  # fmt: skip
"""Spellings of the units of each quantity, separated by blanks, by their factor (and offset) to the column's unit.

Messages and the guide list the spellings before a ``|``. Upper and lower case are equivalent, and so are ``cm²``,
``cm2`` and ``cm^2``.
"""
_CONVERSIONS = {
    quantity: {
        name.casefold(): scale if isinstance(scale, tuple) else (scale, 0.0)
        for scale, names in spellings.items()
        for name in names.replace("|", "").split()
    }
    for quantity, spellings in _SPELLINGS.items()
}

_SIGNALS = {
    "V": "V volt volts", "mV": "mV", "mA": "mA", "μA": "μA uA", "%": "%",
    "count": "count counts cnt cnts digit digits lsb raw inc increments",
}  # fmt: skip
ELECTRICAL = {name.casefold(): signal for signal, names in _SIGNALS.items() for name in names.split()}
"""Electrical signals, which need the sensor's range. A is left out, because it often names a port."""

OTHER_QUANTITIES = {
    "m/s", "mm/s", "cm/s", "in/s", "m/s2", "mm/s2", "m/min", "l/min", "lpm", "gpm", "l/s", "m3/s", "cm3/s", "mm2/s",
    "rpm", "1/min", "u/min", "rad/s", "°/s", "rad", "deg", "°", "%", "nm", "n·m", "n*m", "w", "kw", "hz", "khz", "a",
}  # fmt: skip
"""Units of other quantities that loggers record, in lower case."""

_RARE = "psig psia kg/cm² dm g mN uN μN uV μV MHz deg_c m/s² m/s^2 mm/s² g/s 1/s min-1 J ohm Ω m³/s cm³/s bit bits -"
KNOWN = frozenset().union(*_CONVERSIONS.values(), ELECTRICAL, OTHER_QUANTITIES, _RARE.casefold().split())
"""All known units, in lower case."""

_PORTS = frozenset("ABCFGHKPTXY")  # Letters that more probably name a port or an axis than a unit: 'pressure (A)'
_IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[\s*(?P<unit>[^\[\]]*?)\s*\](?:\s*\([^()]*\))?$")
_IN_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\(\s*(?P<unit>[^()]*?)\s*\)$")
_DIVIDED = re.compile(r"^(?P<name>\S+?\s*/\s*|.*\S (?:in|/) |.* [^\s/]{3,}/(?!s$|min$|h$))(?P<unit>\S+)$")
_ANY, _LONG = (
    "|".join(re.escape(each) for each in sorted(KNOWN) if each[:size].isalpha() and len(each) >= size)
    for size in (1, 2)
)
_NUMBER, _FEW = r"\d+(?:[.,/]\d+)?", r"(?:[2-9]|10|100(?= ?[muμ]s)|\d+[.,/]\d+)"  # 100 bar may be the range of a sensor
SCALED = re.compile(
    rf"\((?:\s*{_FEW}|\s*[x*]\s*{_NUMBER}\s*)\s*(?:{_ANY})\s*\)$|(?<![A-Za-z\d.,/]){_FEW}(?:{_LONG})$"  # (5 ms), _2mm
    rf"|(?:\bin \d+|\d+[.,/]\d+) (?:{_ANY})$"  # in 10 ms, 1/1000 s
    rf"|(?<![A-Za-z])(?:{_LONG})[\])]?[\s_,(]*[*·x/] ?{_NUMBER}\)?$"  # [bar] *10, (kPa/10), bar (x2)
    rf"|^{_NUMBER} ?[*·]|(?<=.)(?:x10+| x {_NUMBER}|(?:[*·×]|(?<=[A-Za-z])/) ?{_NUMBER})(?=\s*[\[(]|$)"  # 10*p, px10
    rf"|(?:scale|factor|faktor|gain)[ =:]*{_NUMBER}",
    re.IGNORECASE,
)
"""A factor in a name, with or without its unit; no unit with a factor is known."""
_FULL_WIDTH = str.maketrans("（）［］【】／", "()[][]/")
_BRACKETS = {"[": "]", "(": ")", "{": "}", "<": ">"}
_REFERENCE = re.compile(r"(?P<unit>.+?)[ _,.-]*\(?(?:(?P<absolute>a|abs|absolute?)|g|gauge|rel|relativ|ü)\.?\)?", re.I)


@cache
def bare(unit: str) -> str:
    """Strip brackets, quotes and blanks from a unit; ``cm²`` becomes ``cm2``, and ``absolute bar`` ``bar abs``."""
    text = unicodedata.normalize("NFKC", unit).strip().strip("\"'").strip()
    while len(text) > 1 and _BRACKETS.get(text[0]) == text[-1]:
        text = text[1:-1].strip()
    return re.sub(r"^abs(?:olute?|\.)? +(.+)", r"\1 abs", text, flags=re.IGNORECASE)


def _squeezed(text: str) -> str:
    return "".join(text.split()).casefold().replace("^", "").replace("**", "")


def electrical(unit: str) -> str | None:
    """Return V, mV, mA, μA, count or % if a unit is a sensor's signal; else None."""
    return ELECTRICAL.get(_squeezed(bare(unit)))


def of_stroke(column: str, unit: str) -> bool:
    return column == POSITION and electrical(unit) == "%"


@cache
def conversion(unit: str, quantity: str) -> tuple[float, float] | None:
    """Look up scale and offset to the column's unit; None if the unit does not measure this quantity."""
    text, known = bare(unit), _CONVERSIONS[quantity]
    found = known.get(_squeezed(text))
    if found is None and quantity == "pressure" and (match := _REFERENCE.fullmatch(text)):
        return known.get(_squeezed(match["unit"]))
    return found


@cache
def quantity_of(unit: str) -> str | None:
    """Find the quantity of a recording that a unit measures; None if there is none."""
    return next((quantity for quantity in _CONVERSIONS if conversion(unit, quantity) is not None), None)


@cache
def stated_reference(unit: str) -> Literal["gauge", "absolute"] | None:
    """Read the reference that a unit of pressure includes: ``bara``, ``psi(g)``; None if it includes none."""
    text, known = bare(unit), _CONVERSIONS["pressure"]
    match = _REFERENCE.fullmatch(text)
    if _squeezed(text) in known or match is None or _squeezed(match["unit"]) not in known:
        return None
    return "absolute" if match["absolute"] else "gauge"


def stated_rate(unit: str) -> float | None:
    """Read a rate that is given in place of a unit of time, such as ``200 Hz`` [Hz]; None for a unit."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?(k?)hz", unit.strip(), re.IGNORECASE)
    return float(match[1]) * (1e3 if match[2] else 1.0) if match else None


def unit_in_name(name: str) -> str | None:
    """Find the unit in a header cell; None without one.

    Text in square brackets is a unit, unless it is an index such as ``axis[1]``. Text in parentheses or after a slash
    may be a remark, and is a unit only if it is known. A factor makes a unit that is not known, such as ``2ms``.
    """
    name = name.translate(_FULL_WIDTH)
    if scaled := SCALED.search(name):
        return scaled[0].strip("() ")
    match = _IN_BRACKETS.match(name)
    if match and match["unit"] and not match["unit"].isdigit():
        return match["unit"]
    for pattern in (_IN_PARENTHESES, _DIVIDED):
        match = pattern.match(name)
        port = match and (match["unit"].upper() in _PORTS or match["unit"] == "pA")  # the pressure at port A
        if match and not port and bare(match["unit"]).casefold() in KNOWN:
            return match["unit"]
    return None


def names_a_unit(text: str) -> bool:
    """Check whether text in a header is meant as a unit; a single capital often names a port, and ``rod`` a side."""
    text = bare(text)
    if len(text) == 1 and text in _PORTS:
        return False
    return electrical(text) is not None or quantity_of(text) is not None or text.casefold() in OTHER_QUANTITIES


def check_unit(column: str, unit: str) -> tuple[float, float]:
    """Return scale and offset to the column's unit; refuse a unit that is unknown or of another quantity."""
    wanted = QUANTITIES[column]
    if wanted == "pressure" and bare(unit) == "mPa":
        raise RecordingError(f"column {column!r}: unit {unit!r} is millipascal; write MPa for megapascal")
    if (found := conversion(unit, wanted)) is not None:
        return found
    if electrical(unit) is not None:
        raise RecordingError(
            f"column {column!r}: unit {unit!r} is a sensor's electrical signal, but the column holds a {wanted}; "
            "state the sensor: {range: [low, high], unit: ..., signal: [low, high]}"
        )
    measured = quantity_of(unit)
    problem = "is not known" if measured is None else f"measures {measured}, but the column holds a {wanted}"
    raise RecordingError(f"column {column!r}: unit {unit!r} {problem}; expected {known_units(wanted)}")


def known_units(quantity: str) -> str:
    """List in words the units of a quantity that a mapping may state, in their usual spelling."""
    usual = [name for names in _SPELLINGS[quantity].values() for name in names.partition("|")[0].split()]
    absolute = "; or bara, psia, ... if absolute" if quantity == "pressure" else ""
    signals = "" if quantity == "time" else f"; or {', '.join(_SIGNALS)} with the sensor"
    return f"one of {', '.join(usual)}{absolute}{signals}"


def to_column_unit(values: Array, unit: str, column: str) -> Array:
    """Convert values to the column's unit, temperatures with their zero; values in that unit stay unchanged."""
    scale, offset = check_unit(column, unit)
    scaled = values if scale == 1.0 else values * scale
    return scaled if offset == 0.0 else scaled + offset


@cache
def units_agree(stated: str, configured: str) -> bool:
    """Check whether a file's unit and the configured one agree but for spelling; text that is no unit does."""
    quantity, signal = quantity_of(configured), electrical(configured)
    if bare(stated) == bare(configured) or not names_a_unit(stated) or (quantity is None and signal is None):
        return True
    if signal is not None or quantity is None:
        plain = {signal, electrical(stated)} == {"count", "%"}  # both are plain numbers, whose range the sensor states
        return plain or electrical(stated) == signal
    one, two = conversion(stated, quantity), conversion(configured, quantity)
    return one is not None and two is not None and math.isclose(one[0], two[0]) and one[1] == two[1]


EACH_SESSION = "each session"


@dataclass(frozen=True)
class SensorScale:
    """A sensor as its data sheet states it."""

    # Readings at the two ends of its signal, in ``unit``; the first may be the larger one. Infinite if not stated
    range: tuple[float, float] = (-math.inf, math.inf)
    unit: str = ""  # Unit of ``range``, for example bar; empty without one
    # Values of the channel at the two ends of ``range``, in the channel's own unit: (4, 20) mA, (0, 10) V, (0, 4095)
    # counts. None if the logger has already converted the signal.
    signal: tuple[float, float] | None = None
    bits: int | None = None  # Resolution of the converter, which divides ``range`` into 2^bits steps, if known
    accuracy_percent: float | None = None  # Stated accuracy [± % of full scale], if known
    # Standard uncertainty (k = 1) of the zero, in ``unit``, if known; the accuracy then applies to the span alone
    zero_uncertainty: float | None = None
    # ``EACH_SESSION`` if the sensor is zeroed anew before each session; empty if it keeps its zero
    zeroed: str = ""
    delay_s: float = 0.0  # Delay of its signal, for example by a filter [s]; subtracted from its time stamps
    line_loss: LineLoss | None = None  # Pressure loss in the line to a pressure sensor away from the cylinder
    serial: str = ""  # Serial number
    calibrated: str = ""  # Day of its last calibration, such as 2026-03-27

    def __post_init__(self) -> None:
        scale = ("range", "unit", "signal", "bits", "accuracy_percent")
        found = {name: own for name in scale if (own := getattr(self, name)) not in (None, "", SensorScale.range)}
        whole = not found or {"range", "unit"} <= found.keys()
        expect(whole, "sensor", "range and unit, such as range: [0, 250], unit: bar", found)
        for name in ("range", "signal") if found else ():
            pair = getattr(self, name)
            valid = pair is None or (len(pair) == 2 and all(map(math.isfinite, pair)) and pair[0] != pair[1])
            expect(valid, f"sensor: {name}", "two different finite numbers", pair)
        accuracy, zero = self.accuracy_percent, self.zero_uncertainty
        expect(self.bits is None or 1 <= self.bits <= 32, "sensor: bits", "1 to 32", self.bits)
        known = accuracy is None or 0.0 <= accuracy <= 100.0
        expect(known, "sensor: accuracy_percent", "0 to 100 (of full scale)", accuracy)
        expect(zero is None or 0.0 <= zero < math.inf, "sensor: zero_uncertainty", "zero or a positive number", zero)
        expect(self.zeroed in ("", EACH_SESSION), "sensor: zeroed", repr(EACH_SESSION), self.zeroed)
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
        stated = {"serial": self.serial, "calibrated": self.calibrated}
        return {name: value for name, value in stated.items() if value}

    @property
    def full_scale(self) -> float:
        """Span of the range, in ``unit``."""
        return abs(self.range[1] - self.range[0])

    def reading(self, signal: Array) -> Array:
        """Convert the signal to readings in ``unit``: linearly, also beyond the ends; without a signal, unchanged."""
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
    time: str = ""  # Time channel of this channel; by default the channel of ``time_s`` in the same table
    time_unit: str = ""  # Unit of that time channel, if the file does not state it
    sensor: SensorScale | None = None  # Scale and limits of the sensor
    offset: float = 0.0  # Reading at which the column is zero, in the sensor's unit: of a position with the rod in
    rate_hz: float | None = None  # Rate of the rows in place of a time channel, only for ``time_s`` [Hz]
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
        if electrical(self.unit) not in (None, "%") and not scaled:
            raise RecordingError(
                f"{where}: unit {self.unit!r} is a sensor's signal and means nothing without its range; "
                "state the sensor: {range: [low, high], unit: ..., signal: [low, high]}"
            )
        if scaled and electrical(self.unit) is None:
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
        sensor = self.sensor or SensorScale()
        if sensor.unit or not of_stroke(column, self.unit):
            return self
        return replace(self, sensor=replace(sensor, range=(0.0, stroke_m), unit="m", signal=(0.0, 100.0)))

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
        return stated_reference(self.reading_unit) == "absolute"

    def correction(self, column: str) -> ChannelCorrection:
        """State the sign and offset that ``column_values`` applies to a reading in the column's unit (gauge)."""
        atmosphere = (self.sign - 1) * STANDARD_ATMOSPHERE_PA if self.absolute else 0.0
        offset = self.offset * check_unit(column, self.reading_unit)[0] if self.offset else 0.0
        return ChannelCorrection(self.sign, offset + atmosphere)

    def column_values(self, raw: Array, column: str) -> Array:
        """Convert a channel's cells to the column's values; return the array itself if nothing changes."""
        reading = raw if self.sensor is None else self.sensor.reading(raw)
        zeroed = reading if self.offset == 0.0 else reading - self.offset
        return self.counted(to_column_unit(zeroed, self.reading_unit, column))

    def counted(self, values: Array) -> Array:
        """Apply the sign to values in the column's unit, and subtract the atmosphere from absolute pressures."""
        signed = values if self.sign == 1 else -values
        return signed - STANDARD_ATMOSPHERE_PA if self.absolute else signed


def check_mapping(mapping: Mapping[str, ChannelMapping]) -> None:
    """Refuse a mapping that cannot make a recording from any file."""
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
        shared = sorted({*other.names} & {*source.names} - {NOT_FOUND})
        if shared and (other.table == source.table or not (other.table and source.table)):
            raise RecordingError(
                f"channel {shared[0]!r} is to fill both {user!r} and {column!r}; expected one column per channel"
            )


def _problem(column: str, source: ChannelMapping) -> str:
    """State a contradiction in a column's mapping; empty if there is none. A unit that does not fit is refused."""
    sensor = source.sensor
    if column == TIME:
        if source.unit:
            check_unit(column, source.unit)
        meaningless = source.sign != 1 or sensor is not None or source.time or source.time_unit
        return "sign, sensor and time have no meaning for time; leave them out" if meaningless else ""
    if source.time_unit:
        check_unit(TIME, source.time_unit)
    if source.rate_hz is not None:
        return f"rate_hz is for {TIME!r} alone; name the channel"
    if sensor is None and of_stroke(column, source.unit):
        return ""
    check_unit(column, source.reading_unit)
    if sensor is not None:
        check_unit(column, sensor.unit or source.unit)
        if not source.absolute and stated_reference(sensor.unit) == "absolute":
            return (
                f"the sensor's unit {sensor.unit!r} is absolute pressure, but the channel is read as gauge; write "
                "its unit as absolute too, such as bara, or give the range in gauge pressure"
            )
        if sensor.line_loss is not None and column not in PRESSURES:
            return "sensor.line_loss is for the cylinder's pressures alone; leave it out"
    return ""


def wanted_channels(mapping: Mapping[str, ChannelMapping]) -> dict[str, str]:
    """List all channels that a mapping reads, time channels included, each with its stated unit, empty without one."""
    clocks = {source.time: source.time_unit for source in mapping.values() if source.time}
    return clocks | {name: source.unit for source in mapping.values() for name in source.names}


def sensor_limits(mapping: Mapping[str, ChannelMapping]) -> dict[str, SensorLimits]:
    """Compute the limits of each stated sensor by column, with unit, offset, atmosphere and sign applied."""
    limits = {}
    for column, source in mapping.items():
        if (sensor := source.sensor) is None or not sensor.unit:
            continue
        offset = source.offset * check_unit(column, source.reading_unit)[0]
        ends = source.counted(to_column_unit(np.array(sensor.range, dtype=np.float64), sensor.unit, column) - offset)
        step = sensor_step(column, sensor, source.unit)
        described = f"{min(sensor.range):g} to {max(sensor.range):g} {sensor.unit}"
        if sensor.signal is not None:
            described += f" ({min(sensor.signal):g} to {max(sensor.signal):g} {source.unit})"
        limits[column] = SensorLimits(float(ends.min()), float(ends.max()), step, described)
    return limits


def channel_corrections(mapping: Mapping[str, ChannelMapping]) -> dict[str, ChannelCorrection]:
    """List the stated sign and offset of each column that has either."""
    stated = {column: source.correction(column) for column, source in mapping.items() if column != TIME}
    return {column: own for column, own in stated.items() if own != ChannelCorrection()}


def sensor_uncertainty(mapping: Mapping[str, ChannelMapping]) -> dict[str, SensorUncertainty]:
    """Compute the standard uncertainty of each sensor with a stated accuracy, by column, before any zeroing.

    A stated accuracy of ± a % of full scale only bounds the error, so that all errors within it are equally likely:
    u = a·FS / √3 (JCGM 100:2008, GUM, 4.3.7). It counts as an error of the zero, because it is constant in a recording
    and possible at any reading. No error of the span is added, because the accuracy covers both together. A sensor
    keeps its zero from session to session unless the mapping states that it is zeroed.
    """
    stated = {}
    for column, source in mapping.items():
        if (sensor := source.sensor) is None or sensor.accuracy_percent is None:
            continue
        resolution = sensor_step(column, sensor, source.unit) or 0.0
        share = sensor.accuracy_percent / 100.0 * RECTANGULAR
        zero, span = share * sensor.full_scale, 0.0
        if sensor.zero_uncertainty is not None:
            zero, span = sensor.zero_uncertainty, share
        zeroed = sensor.zeroed == EACH_SESSION
        stated[column] = SensorUncertainty(zero * check_unit(column, sensor.unit)[0], span, resolution, zeroed)
    return stated


def sensor_step(column: str, sensor: SensorScale, channel_unit: str = "") -> float | None:
    """Compute the converter's step in the column's unit: one count, or the range over 2^bits; None if not known."""
    if sensor.signal is not None and electrical(channel_unit) == "count":
        steps = abs(sensor.signal[1] - sensor.signal[0])
    elif sensor.bits is not None:
        steps = 2.0**sensor.bits
    else:
        return None
    return sensor.full_scale * check_unit(column, sensor.unit)[0] / steps
