from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, check_mapping, wanted_channels
from cylinder_friction.recordings.mapping.sensor import SensorScale
from cylinder_friction.recordings.recording import RecordingError

MAPPING = {
    "time_s": ChannelMapping("t", "ms"),
    "pressure_1_pa": ChannelMapping("a", "bar"),
    "pressure_2_pa": ChannelMapping("b", "psi"),
    "position_m": ChannelMapping("x", "mm", -1),
}


def values(source: ChannelMapping, column: str, *raw: float) -> list[float]:
    return list(source.column_values(np.array(raw), column))


def test_bar_is_one_product_and_own_unit_is_untouched() -> None:
    raw = np.random.default_rng(2).normal(50.0, 20.0, 100)
    np.testing.assert_array_equal(ChannelMapping("a", "bar").column_values(raw, "pressure_1_pa"), raw * 1e5)
    assert ChannelMapping("a", "Pa").column_values(raw, "pressure_1_pa") is raw


def test_position_that_reads_less_when_extending_counts_from_its_offset() -> None:
    source = ChannelMapping("x", "mm", sign=-1, offset=250.0)
    assert values(source, "position_m", 250.0, 150.0, 0.0) == pytest.approx([0.0, 0.1, 0.25])


def test_position_from_a_current_loop() -> None:
    sensor = {"range": [0, 300], "unit": "mm", "signal": [4, 20]}
    source = ChannelMapping.from_dict({"channel": "x", "unit": "mA", "offset": 10.0, "sensor": sensor})
    assert values(source, "position_m", 4.0, 12.0, 20.0) == pytest.approx([-0.01, 0.14, 0.29])


def test_pressure_from_counts_and_from_volts() -> None:
    counts = ChannelMapping("a", "counts", sensor=SensorScale((0.0, 250.0), "bar", (0.0, 4095.0), bits=12))
    assert values(counts, "pressure_1_pa", 0.0, 4095.0) == pytest.approx([0.0, 250e5])
    volts = ChannelMapping("a", "V", sensor=SensorScale((0.0, 3000.0), "psi", (0.5, 4.5)))
    assert values(volts, "pressure_1_pa", 2.5) == pytest.approx([1500.0 * 6894.757293168])


@pytest.mark.parametrize(
    "source",
    [ChannelMapping("a", "bar", reference="absolute"), ChannelMapping("a", "bara"), ChannelMapping("a", "bar (abs)")],
)
def test_absolute_pressure_becomes_gauge(source: ChannelMapping) -> None:
    assert values(source, "pressure_1_pa", 1.01325, 2.01325) == pytest.approx([0.0, 1e5], abs=1e-9)


def test_absolute_sensor_behind_a_current_loop() -> None:
    source = ChannelMapping("a", "mA", sensor=SensorScale((0.0, 10.0), "bara", (4.0, 20.0)))
    assert values(source, "pressure_1_pa", 4.0, 20.0) == pytest.approx([-101325.0, 1e6 - 101325.0])


def test_drive_force_stands_in_for_both_pressures() -> None:
    check_mapping(
        {
            "time_s": ChannelMapping(rate_hz=1000.0),
            "position_m": ChannelMapping("x", "m"),
            "drive_force_n": ChannelMapping("f", "N"),
        }
    )


def test_same_channel_name_in_two_tables_is_two_channels() -> None:
    check_mapping(
        MAPPING
        | {
            "pressure_1_pa": ChannelMapping("p", "bar", table="A"),
            "pressure_2_pa": ChannelMapping("p", "bar", table="B"),
        }
    )


def test_wanted_channels_hold_the_time_channels() -> None:
    mapping = MAPPING | {"position_m": ChannelMapping("x", "mm", time="t_x")}
    assert wanted_channels(mapping) == {"t", "a", "b", "x", "t_x"}
    assert "" not in wanted_channels(MAPPING | {"time_s": ChannelMapping(rate_hz=200.0)})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pressure_3_pa": {"channel": "c", "unit": "bar"}}, "'pressure_3_pa' is not known; expected some of time_s"),
        (
            {"pressure_2_pa": {"channel": "a", "unit": "bar"}},
            "'a' is to fill both 'pressure_1_pa' and 'pressure_2_pa'; expected one column per channel",
        ),
        ({"position_m": {"channel": "x", "unit": "mm", "sign": 2}}, "channel 'x': sign must be 1 or -1, but got 2"),
        ({"position_m": {"channel": "x", "unit": "parsnips"}}, "unit 'parsnips' is not known; expected one of m, mm"),
        ({"position_m": {"channel": "x", "unit": ""}}, "'position_m': unit '' is not known"),
        ({"position_m": {"channel": "", "unit": "mm"}}, "expected the logger's name of the channel, but got ''"),
        ({"position_m": {"rate_hz": 200.0}}, "'position_m': rate_hz is for 'time_s' alone"),
        ({"position_m": {"channel": "x", "unit": "mm", "offset": float("nan")}}, "offset must be a finite number"),
        (
            {"position_m": {"channel": "x", "unit": "mm", "reference": "absolute"}},
            "'position_m': reference: absolute is for pressures alone",
        ),
        (
            {"pressure_1_pa": {"channel": "a", "unit": "bar", "reference": "vacuum"}},
            "reference must be gauge or absolute, but got 'vacuum'",
        ),
        (
            {"pressure_1_pa": {"channel": "a", "unit": "barg", "reference": "absolute"}},
            "unit 'barg' is gauge pressure, but reference is absolute",
        ),
        (
            {"pressure_1_pa": {"channel": "a", "unit": "bar", "sensor": {"range": [0, 10], "unit": "bara"}}},
            "the sensor's unit 'bara' is absolute pressure, but the channel is read as gauge",
        ),
        (
            {"pressure_1_pa": {"channel": "a", "unit": "mA"}},
            "channel 'a': unit 'mA' is a sensor's signal and means nothing without its range; state the sensor",
        ),
        (
            {"pressure_1_pa": {"channel": "a", "unit": "mA", "sensor": {"range": [0, 250], "unit": "bar"}}},
            "unit 'mA' is a sensor's signal and means nothing without its range",
        ),
        (
            {
                "pressure_1_pa": {
                    "channel": "a",
                    "unit": "bar",
                    "sensor": {"range": [0, 250], "unit": "bar", "signal": [4, 20]},
                }
            },
            "unit 'bar' is what the sensor reads already, but its signal is stated too",
        ),
        (
            {
                "pressure_1_pa": {
                    "channel": "a",
                    "unit": "mA",
                    "sensor": {"range": [0, 250], "unit": "mm", "signal": [4, 20]},
                }
            },
            "'pressure_1_pa': unit 'mm' measures length",
        ),
        ({"time_s": {"channel": "t", "unit": "bar"}}, "'time_s': unit 'bar' measures pressure"),
        ({"time_s": {"channel": "t", "unit": "s", "sign": -1}}, "'time_s': sign, sensor and time have no meaning"),
        ({"time_s": {"rate_hz": 0.0}}, "rate_hz must be a positive number .* but got 0.0"),
        ({"time_s": {"channel": "t", "rate_hz": 10.0}}, "rate_hz must be a positive number and takes the place of"),
    ],
)
def test_wrong_mapping_is_refused(change: dict[str, dict[str, Any]], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        check_mapping(MAPPING | {column: ChannelMapping.from_dict(entry) for column, entry in change.items()})


@pytest.mark.parametrize("column", ["time_s", "pressure_1_pa", "position_m"])
def test_mapping_without_a_required_column_is_refused(column: str) -> None:
    with pytest.raises(RecordingError, match=f"'{column}' has no channel; name the logger's channel"):
        check_mapping({other: source for other, source in MAPPING.items() if other != column})
