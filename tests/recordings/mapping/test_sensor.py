from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, sensor_limits, sensor_uncertainty
from cylinder_friction.recordings.mapping.sensor import SensorScale
from cylinder_friction.recordings.recording import RecordingError

CURRENT = SensorScale(range=(0.0, 250.0), unit="bar", signal=(4.0, 20.0))


def test_current_loop_is_linear_between_and_beyond_its_ends() -> None:
    np.testing.assert_allclose(CURRENT.reading(np.array([4.0, 12.0, 20.0, 3.8])), [0.0, 125.0, 250.0, -3.125])


@given(
    low=st.floats(-1e4, 1e4),
    high=st.floats(-1e4, 1e4),
    first=st.floats(-4096.0, 4096.0),
    last=st.floats(-4096.0, 4096.0),
    share=st.floats(-0.5, 1.5),
)
def test_signal_to_range_is_linear(low: float, high: float, first: float, last: float, share: float) -> None:
    assume(abs(high - low) > 1e-3)
    assume(abs(last - first) > 1e-3)
    sensor = SensorScale((low, high), "bar", (first, last))
    reading = sensor.reading(np.array([first + share * (last - first)]))[0]
    assert reading == pytest.approx(low + share * (high - low), rel=1e-6, abs=1e-5 * abs(high - low) + 1e-9)


def test_channel_that_is_scaled_already_passes_untouched() -> None:
    values = np.array([1.0, 2.0])
    assert SensorScale((0.0, 250.0), "bar").reading(values) is values


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"range": (5.0, 5.0)}, r"range must be two different finite numbers, but got \(5.0, 5.0\)"),
        ({"range": (0.0, math.inf)}, "range must be two different finite numbers"),
        ({"signal": (4.0,)}, r"signal must be two different finite numbers, but got \(4.0,\)"),
        ({"bits": 0}, "bits must be 1 to 32, but got 0"),
        ({"accuracy_percent": -0.5}, "accuracy_percent must be 0 to 100 .* but got -0.5"),
        ({"accuracy_percent": 0.5, "zero_uncertainty": -1.0}, "zero_uncertainty must not be negative, but got -1.0"),
        ({"delay_s": -0.02}, "delay_s must not be negative, but got -0.02"),
        ({"zero_uncertainty": 0.1}, "zero_uncertainty needs accuracy_percent"),
    ],
)
def test_impossible_sensor_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        SensorScale.from_dict({"range": [0.0, 250.0], "unit": "bar"} | change)


def test_limits_follow_unit_sign_offset_and_reference() -> None:
    limits = sensor_limits(
        {
            "time_s": ChannelMapping("t", "s"),
            "pressure_1_pa": ChannelMapping("a", "mA", sensor=CURRENT),
            "pressure_2_pa": ChannelMapping("b", "bar", reference="absolute", sensor=SensorScale((0.0, 100.0), "bar")),
            "position_m": ChannelMapping(
                "x", "count", -1, offset=300.0, sensor=SensorScale((0.0, 300.0), "mm", (0.0, 4095.0))
            ),
            "load_force_n": ChannelMapping("f", "N", sensor=SensorScale((-5.0, 5.0), "kN", bits=12)),
        }
    )
    assert set(limits) == {"pressure_1_pa", "pressure_2_pa", "position_m", "load_force_n"}
    first = limits["pressure_1_pa"]
    assert (first.low, first.high, first.step) == (0.0, 250e5, None)
    assert first.described == "0 to 250 bar (4 to 20 mA)"
    second = limits["pressure_2_pa"]
    assert (second.low, second.high) == pytest.approx((-101325.0, 100e5 - 101325.0))
    position = limits["position_m"]
    assert (position.low, position.high, position.step) == pytest.approx((0.0, 0.3, 0.3 / 4095))
    load = limits["load_force_n"]
    assert (load.low, load.high, load.step) == pytest.approx((-5e3, 5e3, 1e4 / 4096))


def test_accuracy_is_a_rectangular_error_of_the_zero() -> None:
    sensor = SensorScale((0.0, 250.0), "bar", (4.0, 20.0), bits=12, accuracy_percent=0.5)
    mapping = {"pressure_1_pa": ChannelMapping("a", "mA", sensor=sensor), "position_m": ChannelMapping("x", "mm")}
    stated = sensor_uncertainty(mapping)
    assert set(stated) == {"pressure_1_pa"}
    assert stated["pressure_1_pa"].zero == pytest.approx(1.25e5 / math.sqrt(3.0))
    assert stated["pressure_1_pa"].span == 0.0
    assert stated["pressure_1_pa"].resolution == pytest.approx(250e5 / 4096)


def test_calibrated_zero_leaves_accuracy_to_the_span() -> None:
    sensor = SensorScale((0.0, 250.0), "bar", accuracy_percent=0.3, zero_uncertainty=0.1)
    stated = sensor_uncertainty({"pressure_1_pa": ChannelMapping("a", "bar", sensor=sensor)})["pressure_1_pa"]
    assert stated.zero == pytest.approx(0.1e5)
    assert stated.span == pytest.approx(0.003 / math.sqrt(3.0))
    assert stated.resolution == 0.0
