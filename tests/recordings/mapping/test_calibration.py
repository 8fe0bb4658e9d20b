import math

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.mapping.calibration import (
    ZeroReading,
    ZeroRules,
    apply_zero,
    find_zero,
    mean_uncertainty,
    session_zero,
)
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, SensorScale
from cylinder_friction.recordings.recording import RecordingError, RecordingMetadata

RATE_HZ = 200
SENSOR = SensorScale((0.0, 250.0), "bar", (4.0, 20.0), bits=12, accuracy_percent=0.5)
MAPPING = {
    "time_s": ChannelMapping("t", "s"),
    "pressure_1_pa": ChannelMapping("a", "mA", sensor=SENSOR),
    "pressure_2_pa": ChannelMapping("b", "mA", sensor=SENSOR),
    "position_m": ChannelMapping("x", "mm"),
}
FOUND = ZeroRules("found")
METADATA = RecordingMetadata("r1", "1", "s1", 1.0 / RATE_HZ)


def session(vented_s: float = 5.0, offsets_bar: tuple[float, float] = (0.6, -0.4), seed: int = 0) -> pd.DataFrame:
    """A vented standstill, then 10 s of strokes under pressure, then 8 s at standstill with closed ports."""
    rng = np.random.default_rng(seed)
    vented, moving, closed = int(vented_s * RATE_HZ), 10 * RATE_HZ, 8 * RATE_HZ
    stroke = np.sin(np.arange(moving) / RATE_HZ * 2.0)
    position_m = np.concatenate([np.full(vented, 0.1), 0.1 + 0.05 * stroke, np.full(closed, 0.1 + 0.05 * stroke[-1])])
    first = np.concatenate([np.zeros(vented), 20.0 + 5.0 * stroke, np.full(closed, 8.0)])
    second = np.concatenate([np.zeros(vented), 15.0 - 5.0 * stroke, np.full(closed, 9.0)])
    noise = rng.normal(0.0, 0.05, (2, len(first)))
    return pd.DataFrame(
        {
            "time_s": np.arange(len(first)) / RATE_HZ,
            "pressure_1_pa": (first + offsets_bar[0] + noise[0]) * 1e5,
            "pressure_2_pa": (second + offsets_bar[1] + noise[1]) * 1e5,
            "position_m": position_m + rng.normal(0.0, 3e-5, len(first)),
        }
    )


def found(table: pd.DataFrame, rules: ZeroRules = FOUND, name: str = "") -> ZeroReading:
    reading = find_zero(table, rules, MAPPING, name)
    assert reading.offsets
    return reading


def test_vented_stretch_is_found_though_a_longer_standstill_follows() -> None:
    reading = found(session())
    assert reading.from_s == pytest.approx(0.0, abs=0.1)
    assert reading.to_s == pytest.approx(5.0, abs=0.1)
    for column, offset_pa in (("pressure_1_pa", 0.6e5), ("pressure_2_pa", -0.4e5)):
        assert abs(reading.offsets[column] - offset_pa) < 4.0 * reading.uncertainty[column]
        assert 0.05e5 / math.sqrt(1000) * 0.8 < reading.uncertainty[column] < 0.05e5 / math.sqrt(1000) * 3.0


def test_stated_window_is_read() -> None:
    reading = found(session(), ZeroRules("window", window_s=(1.0, 3.0)))
    assert (reading.from_s, reading.to_s) == pytest.approx((1.0, 2.995))
    assert reading.offsets["pressure_1_pa"] == pytest.approx(0.6e5, abs=2e3)


def test_zero_on_one_converter_step_hides_half_of_it() -> None:
    table = session().assign(pressure_1_pa=6e3)
    table.loc[5 * RATE_HZ :, "pressure_1_pa"] = 20e5
    step_pa = 250e5 / 4096
    assert found(table).uncertainty["pressure_1_pa"] == pytest.approx(step_pa / math.sqrt(12.0))


def falling(table: pd.DataFrame) -> pd.DataFrame:
    """Let a pressure vent during the first 5 s."""
    return table.assign(pressure_2_pa=table["pressure_2_pa"] + 2e5 * np.exp(-table["time_s"]))


def creeping(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(position_m=table["position_m"] + 3e-4 * table["time_s"])


@pytest.mark.parametrize(
    ("table", "window_s", "message"),
    [
        (session(), (6.0, 9.0), "position_m changes by .* mm from 6 to 8.995 s, the stated window; expected both"),
        (session(), (18.0, 20.0), r"pressure_1_pa reads 8.\d* bar, a zero may be off by 2.5 bar at most, from 18 to"),
        (falling(session()), (0.0, 4.0), r"pressure_2_pa changes by \d.* bar from 0 to 3.995 s"),
        (creeping(session()), (0.0, 3.0), r"position_m changes by 0\.[89].* mm from 0 to 2\.995 s, the stated"),
    ],
)
def test_a_window_under_pressure_is_refused(table: pd.DataFrame, window_s: tuple[float, float], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        find_zero(table, ZeroRules("window", window_s=window_s), MAPPING)


@pytest.mark.parametrize(
    ("vented_s", "rules", "reason"),
    [
        (5.0, ZeroRules("window", window_s=(100.0, 110.0)), "from 100 to 110 s holds 0 s of this recording"),
        (0.5, FOUND, "expected 2 s at standstill with both pressures steady near zero"),
    ],
)
def test_without_a_vented_standstill_there_is_no_zero(vented_s: float, rules: ZeroRules, reason: str) -> None:
    reading = find_zero(session(vented_s), rules, MAPPING)
    assert not reading.offsets
    assert reason in reading.reason


def test_offset_beyond_the_sensors_accuracy_is_trapped_pressure() -> None:
    table = session(offsets_bar=(2.8, 0.0))
    reading = find_zero(table, FOUND, MAPPING)
    assert not reading.offsets
    assert "pressure_1_pa reads 2.8 bar, a zero may be off by 2.5 bar at most" in reading.reason
    # Where no accuracy is stated, the band of 3 bar alone decides.
    unstated = {column: ChannelMapping(column, "bar") for column in MAPPING}
    assert find_zero(table, FOUND, unstated).offsets


def test_none_asks_for_nothing_and_leaves_the_table_alone() -> None:
    table = session()
    reading = find_zero(table, ZeroRules(), MAPPING)
    assert reading == ZeroReading()
    same, metadata = apply_zero(table, METADATA, reading, MAPPING)
    assert same is table
    assert metadata.repairs == ()
    assert metadata.zero_offset == {}
    assert metadata.uncertainty["pressure_1_pa"].zero == pytest.approx(1.25e5 / math.sqrt(3.0))


def test_zeros_are_taken_off_and_what_is_left_uncertain_is_stated() -> None:
    table = session()
    reading = found(table, name="r1")
    zeroed, metadata = apply_zero(table, METADATA, reading, MAPPING)
    rows = slice(0, 4 * RATE_HZ)
    assert abs(zeroed["pressure_1_pa"][rows].mean()) < 1e3
    np.testing.assert_array_equal(zeroed["position_m"], table["position_m"])
    taken_off = table["pressure_2_pa"] - zeroed["pressure_2_pa"]
    np.testing.assert_allclose(taken_off, metadata.zero_offset["pressure_2_pa"], rtol=1e-9)
    left = metadata.uncertainty["pressure_1_pa"]
    assert left.zero == reading.uncertainty["pressure_1_pa"]
    assert left.span == pytest.approx(0.005 / math.sqrt(3.0))
    assert left.resolution == pytest.approx(250e5 / 4096)
    assert len(metadata.repairs) == 1
    assert metadata.repairs[0].startswith("zeros taken off: pressure_1_pa +0.59")
    assert metadata.repairs[0].endswith(f"from {reading.from_s:.4g} to {reading.to_s:.4g} s")
    assert RecordingMetadata.from_dict(metadata.to_dict()) == metadata


def test_zero_of_one_recording_holds_for_its_session() -> None:
    reading = session_zero([find_zero(session(vented_s=0.5), FOUND, MAPPING), found(session(), name="r1")])
    assert reading.offsets
    other = session(vented_s=0.5)
    zeroed, metadata = apply_zero(other, RecordingMetadata("r2", "1", "s1", 1.0 / RATE_HZ), reading, MAPPING)
    assert metadata.repairs[0].endswith("s of r1")
    np.testing.assert_array_equal(zeroed["pressure_1_pa"], other["pressure_1_pa"] - reading.offsets["pressure_1_pa"])


def test_zeros_that_wander_within_a_session_are_less_certain() -> None:
    readings = [found(session(offsets_bar=(offset, 0.0), seed=seed)) for seed, offset in enumerate((0.3, 0.5, 0.7))]
    together = session_zero(readings)
    assert together.offsets
    assert together.offsets["pressure_1_pa"] == pytest.approx(0.5e5, abs=1e3)
    assert together.uncertainty["pressure_1_pa"] == pytest.approx(0.2e5, rel=0.1)
    nothing = session_zero([ZeroReading(reason="x")])
    assert not nothing.offsets
    assert "none read in this session" in nothing.reason


def test_unread_zero_is_said_and_unstated_accuracy_stays_unknown() -> None:
    unstated = {column: ChannelMapping(column, "bar") for column in MAPPING}
    table = session()
    _, metadata = apply_zero(table, METADATA, ZeroReading(reason="zeros not corrected: why"), unstated)
    assert metadata.repairs == ("zeros not corrected: why",)
    _, zeroed = apply_zero(table, METADATA, found(table), unstated)
    assert zeroed.uncertainty == {}


def test_noise_of_the_position_sensor_is_no_motion() -> None:
    table = session()
    noisy = table.assign(position_m=table["position_m"] + np.random.default_rng(7).normal(0.0, 1.2e-4, len(table)))
    assert np.ptp(noisy["position_m"][: 3 * RATE_HZ]) > FOUND.still_m
    for rules in (FOUND, ZeroRules("window", window_s=(0.0, 3.0))):
        assert found(noisy, rules).offsets["pressure_1_pa"] == pytest.approx(0.6e5, abs=2e3)


@pytest.mark.parametrize("memory", [0.9, 0.98])
def test_uncertainty_covers_autocorrelated_noise(memory: float) -> None:
    rng = np.random.default_rng(4)
    means, stated = [], []
    for _ in range(60):
        noise = np.empty(4096)
        noise[0] = 0.0
        kicks = rng.normal(0.0, 1.0, 4096)
        for row in range(1, 4096):
            noise[row] = memory * noise[row - 1] + kicks[row]
        means.append(noise.mean())
        stated.append(mean_uncertainty(noise))
    # As if independent it would be too small by √((1+0.9)/(1-0.9)) = 4.4 and more.
    assert 0.85 < np.mean(stated) / np.std(means) < 1.8
