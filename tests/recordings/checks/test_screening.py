import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.checks.screening import screen_signals
from cylinder_friction.recordings.mapping.channel_mapping import SensorLimits
from cylinder_friction.recordings.recording import RecordingError, Signal

ROWS = 6000
TIME_S = 0.005 * np.arange(ROWS)
STROKE_M = 0.25
LIMITS = {
    "pressure_1_pa": SensorLimits(0.0, 250e5, 250e5 / 4096, "0 to 250 bar (4 to 20 mA)"),
    "position_m": SensorLimits(0.0, 0.25, 0.25 / 4096, "0 to 250 mm (0 to 10 V)"),
    "load_force_n": SensorLimits(-1e4, 1e4, None, "-10 to 10 kN"),
}


def pressure() -> Array:
    """Slow strokes at 40 bar, a twelve-bit sensor with noise."""
    step = 250e5 / 4096
    values = 40e5 + 15e5 * np.sin(TIME_S) + np.random.default_rng(2).normal(0.0, 5e3, ROWS)
    return np.round(values / step) * step


def screen(values: Array, column: str = "pressure_1_pa", known: bool = True) -> tuple[Array, tuple[str, ...]]:
    signals, repairs = screen_signals(
        {column: Signal(TIME_S[: len(values)], values)}, LIMITS if known else {}, STROKE_M
    )
    return signals[column].values, repairs


def with_values(rows: slice | list[int], value: float | Array) -> Array:
    values = pressure()
    values[rows] = value
    return values


@pytest.mark.parametrize(
    ("values", "rows", "message"),
    [
        (with_values([700, 900], -62.5e5), [700, 900], "a sensor of 0 to 250 bar (4 to 20 mA) cannot read; taken as"),
        (with_values([50, 51], 250e5), [50, 51], "is 250 bar in row 51 (2 in all), the end of its sensor's"),
        (with_values([30, 31, 32], 1e5), [30, 31, 32], "is 1 bar in row 31 (3 in all), a spike"),
        (with_values(slice(9, 99), -9999e5), [*range(9, 99)], "-9999 bar in 90 rows (first: row 10), which no sensor"),
    ],
)
def test_a_few_bad_samples_become_missing_and_are_told(values: Array, rows: list[int], message: str) -> None:
    screened, (repair,) = screen(values)
    assert np.flatnonzero(np.isnan(screened)).tolist() == rows
    assert message in repair
    good = np.setdiff1d(np.arange(ROWS), rows)
    assert np.array_equal(screened[good], values[good])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (with_values(slice(1000, 2000), -62.5e5), r"1001 \(1000 in all\), .* expected at most 6, .* wire"),
        (with_values(slice(1000, 1011), 262e5), "in row 1001 .* the sensor is saturated, at most 11 .* wider"),
        (with_values(slice(10, 5990, 100), 90e5), r"a spike: .*; expected at most 6, and 10 in a row; check wire"),
        (with_values(slice(10, 5000, 100), np.inf), r"is inf in row 11 \(50 in all\).* exported"),
    ],
)
def test_many_bad_samples_are_refused(values: Array, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        screen(values)


@given(st.integers(200, ROWS - 200), st.integers(1, 3), st.sampled_from([-1.0, 1.0]), st.floats(8e5, 2e8))
@settings(max_examples=60, deadline=None)
def test_every_lone_spike_is_found_and_nothing_else(row: int, width: int, sign: float, height_pa: float) -> None:
    values = pressure()
    values[row : row + width] += sign * height_pa
    screened, repairs = screen(values, known=False)
    assert np.flatnonzero(np.isnan(screened)).tolist() == list(range(row, row + width))
    assert len(repairs) == 1


def ringing(frequency_hz: float, decay_s: float) -> Array:
    """A valve closes at 10 s: the pressure surges by 30 bar, rings, and settles 8 bar higher."""
    after = np.clip(TIME_S - 10.0, 0.0, None)
    surge = 30e5 * np.exp(-after / decay_s) * np.cos(2.0 * np.pi * frequency_hz * after) + 8e5
    return pressure() + np.where(TIME_S >= 10.0, surge, 0.0)


@pytest.mark.parametrize(
    "values",
    [
        ringing(40.0, 0.05),
        ringing(15.0, 0.1),
        np.where(TIME_S < 10.0, 1e5, 60e5) + pressure(),  # a valve opens
        pressure() + 5e5 * (np.arange(ROWS) // 4 % 2),  # stick-slip as fast as can be
        np.where(np.arange(ROWS) % 500 < 4, 60e5, 40e5),  # four rows are an event
    ],
)
def test_what_hydraulics_do_is_no_spike(values: Array) -> None:
    screened, repairs = screen(values, known=False)
    assert screened is values
    assert repairs == ()


LEGAL = [("pressure_1_pa", 0.0), ("position_m", 0.0), ("position_m", 0.25), ("pressure_1_pa", -2e5)]
SATURATED = [("load_force_n", -1e4), ("load_force_n", 1e4), ("pressure_1_pa", 25e6)]


@pytest.mark.parametrize(("column", "value"), [*LEGAL, *SATURATED])
def test_resting_at_an_end_is_saturation_unless_it_is_legal(column: str, value: float) -> None:
    values = np.full(ROWS, value)
    if (column, value) in LEGAL:
        assert screen(values, column)[0] is values
    else:
        with pytest.raises(RecordingError, match="the sensor is saturated"):
            screen(values, column)


def test_a_channel_slower_than_its_table_is_screened_by_its_own_samples() -> None:
    time_s = 0.0005 * np.arange(10 * ROWS)
    values = np.full(len(time_s), np.nan)
    values[7::10] = with_values([3000], 60e5)
    signals, (said,) = screen_signals({"pressure_1_pa": Signal(time_s, values)}, LIMITS, STROKE_M)
    assert "pressure_1_pa is 60 bar in row 30008 (1 in all), a spike" in said
    screened = signals["pressure_1_pa"].values
    assert np.flatnonzero(np.isnan(screened) & ~np.isnan(values)).tolist() == [30007]
