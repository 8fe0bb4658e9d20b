import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.checks.recording_checks import checked_recording
from cylinder_friction.recordings.checks.recording_checks import inspect_recording as inspected
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata


def inspect_recording(table: pd.DataFrame, limits: CheckLimits, sample_time_s: float) -> list[Finding]:
    return list(inspected(table, limits, sample_time_s))


def check_recording(
    metadata: RecordingMetadata, table: pd.DataFrame, limits: CheckLimits, sample_time_s: float
) -> Recording:
    return checked_recording(metadata, table, inspected(table, limits, sample_time_s))


METADATA = RecordingMetadata("made", "1", "s1", 0.005)
LIMITS = CheckLimits(stroke_m=0.25)
SAMPLE_TIME_S = 0.005


def good(rows: int = 2000) -> pd.DataFrame:
    time_s = SAMPLE_TIME_S * np.arange(rows)
    noise = np.random.default_rng(0).normal(0.0, 5e3, (2, rows))
    return pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": 3e5 + noise[0],
            "pressure_2_pa": 9e5 + noise[1],
            "position_m": 0.12 + 0.1 * np.sin(time_s),
        }
    )


def forced(rows: int = 2000) -> pd.DataFrame:
    table = good(rows)
    force = 200.0 * np.sign(np.cos(table["time_s"])) + np.random.default_rng(1).normal(0.0, 2.0, rows)
    return table[["time_s", "position_m"]].assign(drive_force_n=force)


def test_good_recording_passes_unchanged() -> None:
    recording = check_recording(METADATA, good(), LIMITS, SAMPLE_TIME_S)
    assert recording.metadata.repairs == ()
    pd.testing.assert_frame_equal(recording.table, good())


def test_a_drive_force_stands_in_for_the_pressures() -> None:
    findings = inspect_recording(forced(), LIMITS, SAMPLE_TIME_S)
    assert {finding.outcome for finding in findings} == {"ok"}
    assert not any(finding.check.startswith("pressure") for finding in findings)
    assert [finding.check for finding in findings][-3:] == ["force_stuck", "direction", "position_against_force"]
    check_recording(METADATA, forced(), LIMITS, SAMPLE_TIME_S)


def set_value(column: str, row: int, value: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[row, column] = value
        return table

    return change


def scaled(column: str, factor: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: table[column] * factor})


def both_scaled(factor: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: scaled("pressure_1_pa", factor)(scaled("pressure_2_pa", factor)(table))


def constant(column: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: table[column].iloc[0]})


def stuck_half_way(table: pd.DataFrame) -> pd.DataFrame:
    table.loc[800:1400, "pressure_2_pa"] = 9e5
    return table


def held(table: pd.DataFrame) -> pd.DataFrame:
    table.loc[600:659, "position_m"] = table["position_m"].iloc[600]
    return table


@pytest.mark.parametrize(
    ("spoil", "check", "message"),
    [
        (set_value("pressure_1_pa", 17, np.nan), "finite", r"pressure_1_pa is nan in row 18 \(1 such rows in all\)"),
        (set_value("position_m", 3, np.inf), "finite", "position_m is inf in row 4"),
        (lambda table: table.drop(columns="pressure_2_pa"), "columns", "'pressure_2_pa' is missing; got columns"),
        (lambda table: table.iloc[:500], "length", r"lasts 2.5 s \(500 rows\), expected at least 5 s"),
        (lambda table: table.iloc[:2], "length", "has 2 rows, expected at least 3"),
        (
            scaled("pressure_2_pa", -1.0),
            "pressure_range",
            "-2 to 700 bar gauge; no value is positive, so the sign is rev",
        ),
        (scaled("pressure_1_pa", 1e-5), "pressure_alive", r"changes by 0\.\d+ Pa only .*bar read as Pa"),
        (stuck_half_way, "pressure_stuck", "pressure_2_pa stays at exactly 900000 Pa from row 801 to row 1401 while"),
        (both_scaled(0.1), "unit_plausible", r"is 0.9\d* bar \(pressure_2_pa\), expected at least 2 bar; check the"),
        (
            lambda table: table.assign(pressure_2_pa=table["pressure_1_pa"]),
            "pressures_differ",
            "are equal in every row",
        ),
        (scaled("position_m", 1e3), "position_range", r"expected 0 to 0.25 m, the stroke; .* \(mm read as m\?\)"),
        (scaled("position_m", 1e-3), "motion", r"position_m moves by 0.000\d+ m only, .* \(m read as mm\?\)"),
        (held, "position_stuck", r"stays at exactly 0.1\d+ m from row 601 to row 660 and goes on at 0.\d+ m \(1 such"),
    ],
)
def test_unusable_is_refused(spoil: Callable[[pd.DataFrame], pd.DataFrame], check: str, message: str) -> None:
    table = spoil(good()).reset_index(drop=True)
    with pytest.raises(RecordingError, match=message):
        check_recording(METADATA, table, LIMITS, SAMPLE_TIME_S)
    refused = [f for f in inspect_recording(table, LIMITS, SAMPLE_TIME_S) if f.outcome == "refused"]
    assert refused[0].check == check
    assert re.search(message, refused[0].text)


@pytest.mark.parametrize(
    ("spoil", "check", "message"),
    [
        (constant("drive_force_n"), "force_alive", r"drive_force_n is constant \(at .* N\) while the cylinder moves"),
        (scaled("drive_force_n", 1e-6), "force_alive", r"drive_force_n changes by 0.000\d+ N only"),
        (
            lambda table: table.assign(drive_force_n=table["drive_force_n"].where(table.index < 600, 150.0)),
            "force_stuck",
            "drive_force_n stays at exactly 150 N from row 601 to row 2000 while the piston travels",
        ),
        (scaled("drive_force_n", -1.0), "direction", "friction would drive the piston"),
    ],
)
def test_an_unusable_drive_force_is_refused(
    spoil: Callable[[pd.DataFrame], pd.DataFrame], check: str, message: str
) -> None:
    with pytest.raises(RecordingError, match=message):
        check_recording(METADATA, spoil(forced()), LIMITS, SAMPLE_TIME_S)
    findings = inspect_recording(spoil(forced()), LIMITS, SAMPLE_TIME_S)
    assert [finding.check for finding in findings if finding.outcome == "refused"] == [check]


@pytest.mark.parametrize(("rate_hz", "outcome"), [(200.0, "ok"), (50.0, "ok"), (49.99, "ok"), (40.0, "refused")])
def test_a_rate_too_low_for_the_filters_is_refused(rate_hz: float, outcome: str) -> None:
    findings = {finding.check: finding for finding in inspect_recording(good(), LIMITS, 1.0 / rate_hz)}
    assert findings["rate"].outcome == outcome
    if outcome == "refused":
        assert findings["rate"].text.startswith("is sampled at 40 Hz, expected at least 50 Hz; the filters would smear")


def test_inspection_reports_every_refusal() -> None:
    table = both_scaled(0.1)(scaled("position_m", 1e3)(good().iloc[:500]))
    refused = [f.check for f in inspect_recording(table, LIMITS, 1.0 / 20.0) if f.outcome == "refused"]
    assert refused == ["rate", "position_range", "unit_plausible"]


def test_vented_pneumatics_pass_once_told() -> None:
    limits = replace(LIMITS, least_peak_pressure_pa=2e4)
    check_recording(METADATA, both_scaled(0.1)(good()), limits, SAMPLE_TIME_S)


def test_a_piston_that_rests_while_another_moves_is_noted() -> None:
    table = good().assign(position_m=0.12)
    found = {each.check: each for each in inspect_recording(table, LIMITS, SAMPLE_TIME_S)}
    assert found["motion"].outcome == "refused"
    moving = table.assign(other_position_1_m=0.4 + np.linspace(0.0, 0.01, len(table)))
    found = {each.check: each for each in inspect_recording(moving, LIMITS, SAMPLE_TIME_S)}
    assert found["motion"].outcome == "noted"
    assert (
        "moves by 0 m only, while other_position_1_m moves by 0.01 m: the piston rests, or its sensor"
        in found["motion"].text
    )
    check_recording(METADATA, moving, LIMITS, SAMPLE_TIME_S)


def test_rest_at_the_end_stop_is_no_held_position() -> None:
    table = good()
    table["position_m"] = np.round(np.clip(0.25 * np.sin(2.0 * table["time_s"]), 0.0, 0.2), 4)
    findings = {finding.check: finding.outcome for finding in inspect_recording(table, LIMITS, SAMPLE_TIME_S)}
    assert findings["position_stuck"] == "ok"


@pytest.mark.parametrize(("noise_n", "outcome"), [(2.0, "refused"), (0.0, "ok")])
def test_a_load_cell_whose_noise_ceases_for_a_long_travel_is_stuck(noise_n: float, outcome: str) -> None:
    """One without noise may well stand still: a weight is constant."""
    load_n = np.where(np.arange(2000) < 1000, 300.0, 500.0)
    load_n += noise_n * np.random.default_rng(0).standard_normal(2000)
    load_n[600:1100] = load_n[600]
    findings = inspect_recording(forced().assign(load_force_n=load_n), replace(LIMITS, load="measured"), SAMPLE_TIME_S)
    (finding,) = (each for each in findings if each.check == "load_stuck")
    assert finding.outcome == outcome
    if outcome == "refused":
        assert finding.text == (
            f"load_force_n stays at exactly {load_n[600]:.6g} N from row 601 to row 1100 while the piston travels "
            "0.114 m, and changes from row to row elsewhere; the load cell or its amplifier was stuck; cut the log "
            "there"
        )


def test_what_is_noted_goes_with_the_recording() -> None:
    table = forced().assign(load_force_n=0.0)
    limits = replace(LIMITS, load="measured")
    metadata = replace(METADATA, repairs=("a gap was bridged",))
    recording = check_recording(metadata, table, limits, SAMPLE_TIME_S)
    assert recording.metadata.repairs == (
        "a gap was bridged",
        "load_force_n is constant (at 0 N); the load cell is idle, stuck or not connected",
    )


@given(
    st.lists(st.sampled_from(["pressure_1_pa", "pressure_2_pa", "position_m"]), min_size=1, max_size=3),
    st.floats(-1e9, 1e9),
    st.floats(-1e9, 1e9),
    st.integers(0, 60),
)
def test_whatever_the_numbers_only_the_projects_own_error_comes(
    columns: list[str], factor: float, shift: float, rows: int
) -> None:
    table = good().iloc[: 20 * rows]
    table = table.assign(**{column: table[column] * factor + shift for column in columns})
    limits = CheckLimits(0.25, 3e-3, 2e-3, minimum_duration_s=0.1)
    refused = [f.text for f in inspect_recording(table, limits, SAMPLE_TIME_S) if f.outcome == "refused"]
    if refused:
        with pytest.raises(RecordingError, match=re.escape(refused[0])):
            check_recording(METADATA, table, limits, SAMPLE_TIME_S)
    else:
        assert len(check_recording(METADATA, table, limits, SAMPLE_TIME_S)) == len(table)
