from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.recordings import CheckLimits, RecordingError, RecordingMetadata, check_recording
from cylinder_friction.recordings.checks import constant_sample_time

if TYPE_CHECKING:
    from collections.abc import Callable

METADATA = RecordingMetadata("made", "1", "s1", 0.0)
LIMITS = CheckLimits(stroke_m=0.25)


def good(rows: int = 2000) -> pd.DataFrame:
    time_s = 0.005 * np.arange(rows)
    noise = np.random.default_rng(0).normal(0.0, 5e3, (2, rows))
    return pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": 3e5 + noise[0],
            "pressure_2_pa": 9e5 + noise[1],
            "position_m": 0.12 + 0.1 * np.sin(time_s),
        }
    )


def test_good_recording_passes_unchanged() -> None:
    recording = check_recording(METADATA, good(), LIMITS)
    assert recording.sample_time_s == 0.005
    pd.testing.assert_frame_equal(recording.table, good())


def set_value(column: str, row: int, value: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[row, column] = value
        return table

    return change


def scaled(column: str, factor: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: table[column] * factor})


def constant(column: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: table[column].iloc[0]})


def stuck_half_way(table: pd.DataFrame) -> pd.DataFrame:
    table.loc[800:1400, "pressure_2_pa"] = 9e5
    return table


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (set_value("pressure_1_pa", 17, np.nan), r"pressure_1_pa is nan in row 18 \(1 such rows in all\)"),
        (set_value("position_m", 3, np.inf), "position_m is inf in row 4"),
        (set_value("time_s", 100, 0.4), "time_s does not increase: 0.4 s in row 101 follows 0.495 s"),
        (lambda table: table.drop(index=[50]), "not at a constant rate: 0.01 s before row 51, elsewhere 0.005 s"),
        (lambda table: table.iloc[:500], r"lasts 2.5 s \(500 rows\), expected at least 5 s"),
        (lambda table: table.iloc[:2], "has 2 rows, expected at least 3"),
        (constant("pressure_2_pa"), r"pressure_2_pa is constant \(at .* Pa\) while the cylinder moves"),
        (stuck_half_way, "pressure_2_pa stays at exactly 900000 Pa from row 801 to row 1401 while the piston travels"),
        (scaled("pressure_1_pa", 1e-5), r"changes by 0\.\d+ Pa only .*bar read as Pa"),
        (scaled("pressure_1_pa", 1e3), r"pressure_1_pa is .* bar in row \d+, expected -2 to 700 bar gauge"),
        (scaled("pressure_2_pa", -1.0), "expected -2 to 700 bar gauge; check unit .* and sign"),
        (scaled("position_m", 1e3), r"expected 0 to 0.25 m, the stroke; check unit \(mm read as m\?\)"),
        (scaled("position_m", -1.0), "check unit .*, sign and zero of the sensor"),
        (scaled("position_m", 1e-3), r"position_m moves by 0.000\d+ m only, .* \(m read as mm\?\)"),
        (constant("position_m"), "position_m moves by 0 m only, .* nothing moves"),
    ],
)
def test_unusable_is_refused(spoil: Callable[[pd.DataFrame], pd.DataFrame], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        check_recording(METADATA, spoil(good()).reset_index(drop=True), LIMITS)


@given(st.integers(1, 1998), st.integers(1, 50))
def test_every_gap_is_found_at_its_row(row: int, lost: int) -> None:
    time_s = 0.005 * np.arange(2000)
    time_s[row:] += 0.005 * lost
    with pytest.raises(RecordingError, match=f"before row {row + 1},"):
        constant_sample_time(time_s, 0.2)


@given(st.integers(10, 2000))
def test_rounded_time_gives_the_exact_rate(rate_hz: int) -> None:
    time_s = np.round(np.arange(6 * rate_hz) / rate_hz, 5)
    assert constant_sample_time(time_s, 0.2) == 1.0 / rate_hz
