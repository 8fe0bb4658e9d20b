import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.recordings.columns import QUANTITIES
from cylinder_friction.recordings.mapping.channel_mapping import (
    ChannelMapping,
    SensorScale,
    check_mapping,
    check_unit,
    sensor_limits,
    sensor_uncertainty,
    to_column_unit,
)
from cylinder_friction.recordings.recording import RecordingError
from logger_files import CHANNELS

MAPPING = {column: ChannelMapping.from_dict(entry) for column, entry in CHANNELS.items()}


OWN = {"time": "s", "pressure": "Pa", "length": "m", "force": "N", "temperature": "°C"}
COUNTS = SensorScale((0.0, 250.0), "bar", (0.0, 4095.0), bits=12)
ABSOLUTE_LOOP, VOLTS = SensorScale((0.0, 10.0), "bara", (4.0, 20.0)), SensorScale((0.0, 3000.0), "psi", (0.5, 4.5))
POSITION_LOOP, COUNTED = (SensorScale((0.0, 300.0), "mm", signal) for signal in ((4.0, 20.0), (0.0, 4095.0)))


@pytest.mark.parametrize(
    ("column", "source", "raw", "expected"),
    [
        ("position_m", ChannelMapping("x", "mm", sign=-1, offset=250.0), [250.0, 150.0, 0.0], [0.0, 0.1, 0.25]),
        ("position_m", ChannelMapping("x", "mA", offset=10.0, sensor=POSITION_LOOP), [4.0, 12.0], [-0.01, 0.14]),
        ("pressure_1_pa", ChannelMapping("a", "counts", sensor=COUNTS), [0.0, 4095.0], [0.0, 250e5]),
        ("pressure_1_pa", ChannelMapping("a", "V", sensor=VOLTS), [2.5], [1500.0 * 6894.757293168]),
        ("pressure_1_pa", ChannelMapping("a", "bar (abs)"), [1.01325, 2.01325], [0.0, 1e5]),
        ("pressure_1_pa", ChannelMapping("a", "mA", sensor=ABSOLUTE_LOOP), [4.0, 20.0], [-101325.0, 1e6 - 101325.0]),
    ],
)
def test_values_become_si_units(column: str, source: ChannelMapping, raw: list[float], expected: list[float]) -> None:
    assert list(source.column_values(np.array(raw), column)) == pytest.approx(expected, rel=1e-9, abs=1e-9)


BAR = {"range": [0, 250], "unit": "bar"}
LOOP, LOSS = {"signal": [4, 20]}, {"line_loss": {"bar": 3.0, "speed_m_s": 0.25}}
SIGNAL = "is a sensor's signal and means nothing without its range; state the sensor"


@pytest.mark.parametrize(
    ("column", "change", "message"),
    [
        ("pressure_3_pa", {"unit": "bar"}, "'pressure_3_pa' is not known; expected some of time_s"),
        ("pressure_2_pa", {"channel": "p1"}, "'p1' is to fill both 'pressure_1_pa' and 'pressure_2_pa'; expected one"),
        ("position_m", {"sign": 2}, "channel 'a': sign: expected 1 or -1, but got 2"),
        ("position_m", {"unit": "parsnips"}, "unit 'parsnips' is not known; expected one of m, mm"),
        ("position_m", {"unit": "bar"}, r"'position_m': unit 'bar' measures pressure, .* holds a length; expected one"),
        ("position_m", {"sensor": BAR | {"unit": "mA"}}, r"'mA' is a sensor's electrical signal, .* state the sensor:"),
        ("pressure_1_pa", {"unit": "mPa"}, "unit 'mPa' is millipascal; write MPa for megapascal"),
        ("oil_temperature_c", {"unit": "delta_degC"}, "is not known; expected one of °C, K, °F"),
        ("position_m", {"unit": ""}, "'position_m': unit '' is not known"),
        ("position_m", {"sensor": {"bits": 12}}, "sensor: expected range and unit, such as .* but got {'bits': 12}"),
        ("position_m", {"channel": "", "rate_hz": 200.0}, "'position_m': rate_hz is for 'time_s' alone"),
        ("position_m", {"offset": float("nan")}, "offset: expected a finite number"),
        ("position_m", {"sensor": BAR | {"unit": "mm"} | LOSS}, "sensor.line_loss is for the cylinder's pressures al"),
        ("pressure_1_pa", {"unit": "bar", "sensor": BAR | {"unit": "bara"}}, "the sensor's unit 'bara' is absolute"),
        ("pressure_1_pa", {"unit": "mA"}, f"channel 'a': unit 'mA' {SIGNAL}"),
        ("pressure_1_pa", {"unit": "mA", "sensor": BAR}, f"unit 'mA' {SIGNAL}"),
        ("pressure_1_pa", {"unit": "bar", "sensor": BAR | LOOP}, "unit 'bar' is what the sensor reads already, but"),
        ("pressure_1_pa", {"unit": "mA", "sensor": BAR | LOOP | {"unit": "mm"}}, "unit 'mm' measures length"),
        ("time_s", {"unit": "bar"}, "'time_s': unit 'bar' measures pressure"),
        ("time_s", {"unit": "s", "sign": -1}, "'time_s': sign, sensor and time have no meaning"),
        ("time_s", {"channel": "", "rate_hz": 0.0}, "rate_hz: expected a positive number .* but got 0.0"),
        ("time_s", {"rate_hz": 10.0}, "rate_hz: expected a positive number in place of a channel"),
    ],
)
def test_wrong_mapping_is_refused(column: str, change: dict[str, Any], message: str) -> None:
    unit = {"position_m": "mm", "pressure_1_pa": "bar", "pressure_2_pa": "bar"}.get(column, "")
    with pytest.raises(RecordingError, match=message):
        check_mapping(MAPPING | {column: ChannelMapping.from_dict({"channel": "a", "unit": unit, **change})})


@pytest.mark.parametrize("quantity", OWN)
def test_an_unknown_unit_is_answered_with_the_units_of_the_guide(quantity: str) -> None:
    guide = (Path(__file__).parents[3] / "docs/logger-files.md").read_text(encoding="utf-8")
    column = next(column for column in QUANTITIES if QUANTITIES[column] == quantity)
    with pytest.raises(RecordingError, match="unit 'furlong' is not known; expected one of ") as refused:
        check_unit(column, "furlong")
    assert f"`{str(refused.value).partition('one of ')[2].partition(';')[0].replace(',', '')}`" in guide


@pytest.mark.parametrize("column", ["time_s", "pressure_1_pa", "position_m"])
def test_mapping_without_a_required_column_is_refused(column: str) -> None:
    with pytest.raises(RecordingError, match=f"'{column}' has no channel; name the logger's channel"):
        check_mapping({other: source for other, source in MAPPING.items() if other != column})


LOOP, ABSOLUTE = SensorScale((0.0, 250.0), "bar", (4.0, 20.0)), SensorScale((0.0, 100.0), "bara")
CELL, COUNTER = SensorScale((-5.0, 5.0), "kN", bits=12), ChannelMapping("x", "count", -1, offset=300.0, sensor=COUNTED)


@pytest.mark.parametrize(
    ("column", "source", "low", "high", "step", "described"),
    [
        ("pressure_1_pa", ChannelMapping("a", "mA", sensor=LOOP), 0.0, 250e5, None, "0 to 250 bar (4 to 20 mA)"),
        ("pressure_2_pa", ChannelMapping("b", "bara", sensor=ABSOLUTE), -101325.0, 9898675.0, None, "0 to 100 bara"),
        ("position_m", COUNTER, 0.0, 0.3, 0.3 / 4095, "0 to 300"),
        ("load_force_n", ChannelMapping("f", "N", sensor=CELL), -5e3, 5e3, 1e4 / 4096, "-5 to 5 kN"),
    ],
)
def test_limits_follow_unit_sign_offset_and_reference(
    column: str, source: ChannelMapping, low: float, high: float, step: float | None, described: str
) -> None:
    limits = sensor_limits({"time_s": ChannelMapping("t", "s"), column: source})
    assert set(limits) == {column}
    assert (limits[column].low, limits[column].high) == pytest.approx((low, high))
    assert limits[column].step == (None if step is None else pytest.approx(step))
    assert limits[column].described.startswith(described)


@pytest.mark.parametrize(
    ("sensor", "zero_pa", "span", "resolution_pa"),
    [
        (SensorScale((0.0, 250.0), "bar", bits=12, accuracy_percent=0.5), 1.25e5 / math.sqrt(3.0), 0.0, 250e5 / 4096),
        (SensorScale((0.0, 250.0), "bar", accuracy_percent=0.3, zero_uncertainty=0.1), 1e4, 3e-3 / math.sqrt(3.0), 0.0),
    ],
)
def test_accuracy_is_rectangular(sensor: SensorScale, zero_pa: float, span: float, resolution_pa: float) -> None:
    """An error of the zero, or of the span beside a calibrated zero."""
    mapping = {"pressure_1_pa": ChannelMapping("a", "bar", sensor=sensor), "position_m": ChannelMapping("x", "mm")}
    ((column, stated),) = sensor_uncertainty(mapping).items()
    assert column == "pressure_1_pa"
    assert (stated.zero, stated.span, stated.resolution) == pytest.approx((zero_pa, span, resolution_pa))
    assert not stated.zeroed  # what nobody states is kept


def test_a_sensor_keeps_its_zero_unless_the_mapping_states_that_it_is_zeroed() -> None:
    entry = {"channel": "a", "unit": "bar", "sensor": {"range": [0, 250], "unit": "bar", "accuracy_percent": 0.5}}
    entry["sensor"]["zeroed"] = "each session"  # type: ignore[index]
    assert sensor_uncertainty({"pressure_1_pa": ChannelMapping.from_dict(entry)})["pressure_1_pa"].zeroed
    with pytest.raises(RecordingError, match="sensor: zeroed: expected 'each session', but got 'daily'"):
        SensorScale((0.0, 250.0), "bar", accuracy_percent=0.5, zeroed="daily")


@pytest.mark.parametrize(
    ("column", "value", "unit", "expected"),
    [
        ("pressure_1_pa", 14.503773773, "psi", 1e5),
        *[("pressure_1_pa", 14.503773773, text, 1e5) for text in ("PSI", "psig", "psia", "psi (abs)", "psi gauge")],
        *[("pressure_1_pa", 1.0, text, 98066.5) for text in ("kgf/cm2", "kgf/cm^2")],
        *[("pressure_1_pa", 1.0, text, 1e6) for text in ("N/mm²", "MPa", "MPA")],
        *[("pressure_1_pa", 3.0, text, 3e5) for text in ("bar", "[bar]", "BAR", " bar ", "(bar)", "barg", "bar(a)")],
        ("position_m", 10.0, "in", 0.254),
        *[("position_m", 250.0, text, 0.25) for text in ("mm", "mm ", "MM", "[ mm ]", '"mm"')],
        ("position_m", 250.0, "µm", 250e-6),
        ("time_s", 1500.0, "us", 1.5e-3),
        *[("time_s", 17.3, text, 17.3) for text in ("sec", "Sek", "S", "seconds")],
        ("load_force_n", 1.0, "kip", 4448.2216152605),
        ("drive_force_n", 1.0, "lbf", 4.4482216152605),
        ("oil_temperature_c", 212.0, "°F", 100.0),
        *[("oil_temperature_c", 17.3, text, 17.3) for text in ("degC", "deg C", "℃", "Celsius", "C")],
    ],
)
def test_conversion_of_every_spelling(column: str, value: float, unit: str, expected: float) -> None:
    assert to_column_unit(np.array([value]), unit, column)[0] == pytest.approx(expected, rel=1e-9, abs=1e-12)
