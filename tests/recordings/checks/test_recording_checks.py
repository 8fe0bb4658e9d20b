from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding
from cylinder_friction.recordings.checks.recording_checks import checked_recording, inspect_recording
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from logger_files import columns_of

METADATA = RecordingMetadata("made", "1", "s1", 0.005)
LIMITS = CheckLimits(Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0))
SAMPLE_TIME_S = 0.005


def inspect(table: pd.DataFrame, limits: CheckLimits = LIMITS, sample_time_s: float = SAMPLE_TIME_S) -> list[Finding]:
    return list(inspect_recording(columns_of(table), limits, sample_time_s))


def check(table: pd.DataFrame, limits: CheckLimits = LIMITS, metadata: RecordingMetadata = METADATA) -> Recording:
    return checked_recording(Recording.unchecked(metadata, columns_of(table)), limits)


def good(rows: int = 2000) -> pd.DataFrame:
    """A sine of 0.1 m against friction of about 1 kN."""
    time_s = SAMPLE_TIME_S * np.arange(rows)
    noise = np.random.default_rng(0).normal(0.0, 5e3, (2, rows))
    driving_pa = 7.22e5 + 3.2e5 * np.sign(np.cos(time_s)) + noise[0]
    pressures = {"pressure_1_pa": driving_pa, "pressure_2_pa": 9e5 + noise[1]}
    return pd.DataFrame({"time_s": time_s, **pressures, "position_m": 0.12 + 0.1 * np.sin(time_s)})


def forced(rows: int = 2000) -> pd.DataFrame:
    table = good(rows)
    force = 200.0 * np.sign(np.cos(table["time_s"])) + np.random.default_rng(1).normal(0.0, 2.0, rows)
    return table[["time_s", "position_m"]].assign(drive_force_n=force)


def test_a_rounded_pressure_is_not_stuck_if_its_steps_are_stated() -> None:
    table = good()
    table["pressure_1_pa"] = 1e5 * np.round(5.0 + 1.2 * np.sin(0.4 * table["time_s"]))
    (refused,) = [each for each in inspect(table) if each.outcome == "refused"]
    words = "or its values are rounded: then state its range and bits as its sensor in the mapping"
    assert refused.text.endswith(words)
    stated = replace(LIMITS, steps={"pressure_1_pa": 1e5})
    assert not any(each.outcome == "refused" for each in inspect(table, stated))
    jumps = table.assign(pressure_1_pa=np.where(table.index < 1000, 3e5, 8e5))
    with pytest.raises(RecordingError, match="pressure_1_pa stays at exactly 300000 Pa from row 1 to row 1000"):
        check(jumps, stated)


Spoil = Callable[[pd.DataFrame], pd.DataFrame]


def scaled(factor: float, *columns: str) -> Spoil:
    return lambda table: table.assign(**table[list(columns)] * factor)


def driven(spoil: Callable[[pd.Series], pd.Series]) -> Spoil:
    """Replace the pressures by a spoiled drive force."""
    return lambda _: forced().assign(drive_force_n=lambda table: spoil(table["drive_force_n"]))


def in_psi(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(**table[list(PRESSURES)].mul(np.where(table.index < 1000, 1.0, 14.5), axis=0))


def in_turn(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(pressure_1_pa=table["pressure_1_pa"] + 2e5 * (table.index % 2))


PRESSURES = ("pressure_1_pa", "pressure_2_pa")
PNEUMATIC = replace(LIMITS, least_peak_pressure_pa=2e4)


@pytest.mark.parametrize(
    ("table", "limits"), [(good(), LIMITS), (forced(), LIMITS), (scaled(0.1, *PRESSURES)(good()), PNEUMATIC)]
)
def test_a_good_recording_passes_unchanged(table: pd.DataFrame, limits: CheckLimits) -> None:
    recording = check(table, limits)
    assert recording.metadata.repairs == ()
    pd.testing.assert_frame_equal(recording.table, table)


@pytest.mark.parametrize(
    ("spoil", "name", "message"),
    [
        (lambda table: table.iloc[:500], "length", r"lasts 2.5 s \(500 rows\), expected at least 5 s"),
        (scaled(-1.0, "pressure_2_pa"), "pressure_range", "-2 to 700 bar gauge; no value is positive, so the sign"),
        (scaled(1e-6, "pressure_1_pa"), "pressure_alive", r"changes by 0\.\d+ Pa only .*bar read as Pa"),
        (in_psi, "unit_changed", "both pressures change by a factor of 14.* behind row 1000, as if their unit had"),
        (in_turn, "mixed_rows", "pressure_1_pa changes by 2.* bar from row to row, but by 0.* bar over 2 rows: ro"),
        (scaled(1e3, "position_m"), "position_range", r"expected 0 to 0.25 m, the stroke; .* \(mm read as m\?\)"),
        (scaled(1e-3, "position_m"), "motion", r"position_m moves by 0.000\d+ m only, .* \(m read as mm\?\)"),
        (driven(lambda n: 0.0 * n + 150.0), "force_alive", r"drive_force_n is constant \(at .* N\) while the cylinder"),
        (driven(lambda n: 1e-6 * n), "force_alive", r"drive_force_n changes by 0.000\d+ N only"),
        (driven(lambda n: n.where(n.index < 600, 150.0)), "force_stuck", "exactly 150 N from row 601 to row 2000"),
    ],
)
def test_unusable_is_refused(spoil: Spoil, name: str, message: str) -> None:
    table = spoil(good()).reset_index(drop=True)
    with pytest.raises(RecordingError, match=message):
        check(table)
    assert next(each.check for each in inspect(table) if each.outcome == "refused") == name


@pytest.mark.parametrize(("rate_hz", "refused"), [(200.0, False), (50.0, False), (49.99, False), (40.0, True)])
def test_a_rate_too_low_for_the_filters_is_refused(rate_hz: float, refused: bool) -> None:
    findings = [each for each in inspect(good(), sample_time_s=1.0 / rate_hz) if each.check == "rate"]
    assert [each.outcome for each in findings] == ["refused"] * refused
    words = "is sampled at 40 Hz, expected at least 50 Hz; the filters would smear"
    assert all(each.text.startswith(words) for each in findings)


@pytest.mark.parametrize(("rows", "late", "refused"), [(20, 0, True), (7, 1, True), (4, 0, False)])
def test_samples_held_over_many_rows_are_refused_as_too_slow(rows: int, late: int, refused: bool) -> None:
    """A refresh may come a row late; slow motion over the steps of a converter is as even, and so is 50 Hz."""
    table, at = good(4000), np.arange(4000)
    first = at // rows * rows
    first = np.where(at < first + first // rows % (late + 1), first - rows, first).clip(0)
    for held in (table.assign(**table[list(PRESSURES)].iloc[first].reset_index(drop=True)), table.iloc[first]):
        held = held.reset_index(drop=True).assign(time_s=table["time_s"])
        found = [each.text for each in inspect(held) if each.check == "refresh"]
        assert [f"pressure_2_pa come only every {rows} rows, at" in each for each in found] == [True] * refused
    coarse = inspect(table.assign(position_m=5e-4 * (at // 10), pressure_2_pa=9e5 + 5e4 * np.sin(1.57 * at + 0.3)))
    assert not {each.check for each in coarse} & {"refresh", "mixed_rows"}


@pytest.mark.parametrize("step_m", [1e-5, 5e-5])
def test_an_encoder_without_noise_that_creeps_between_strokes_is_not_held(step_m: float) -> None:
    """Its steps are as even as those of a held position while it creeps, but it changes in every row of a stroke."""
    row = np.arange(4000)
    speed_m_s = np.where(row % 60 < 40, 40.0 * step_m, 0.05) * np.where(row % 1200 < 600, 1.0, -1.0)
    position_m = np.round((0.05 + 0.005 * np.cumsum(speed_m_s)) / step_m) * step_m
    found = inspect(good(4000).assign(position_m=position_m))
    assert not {each.check for each in found} & {"refresh", "position_steps"}


def test_a_piston_that_rests_while_another_moves_is_noted() -> None:
    table = good().assign(position_m=0.12)
    with pytest.raises(RecordingError, match="position_m moves by 0 m only"):
        check(table)
    moving = table.assign(other_position_1_m=0.4 + np.linspace(0.0, 0.01, len(table)))
    words = "while other_position_1_m moves by 0.01 m: the piston rests, or its sensor"
    assert any(words in each for each in check(moving).metadata.repairs)


@pytest.mark.parametrize(("noise_n", "outcome"), [(2.0, ["refused"]), (0.0, [])])
def test_a_load_cell_whose_noise_ceases_for_a_long_travel_is_stuck(noise_n: float, outcome: list[str]) -> None:
    """One without noise may well stand still: a weight is constant."""
    load_n = np.where(np.arange(2000) < 1000, 300.0, 500.0)
    load_n += noise_n * np.random.default_rng(0).standard_normal(2000)
    load_n[600:1100] = load_n[600]
    findings = inspect(forced().assign(load_force_n=load_n), replace(LIMITS, load="measured"))
    found = [each for each in findings if each.check == "load_stuck"]
    assert [each.outcome for each in found] == outcome
    for finding in found:
        assert f"load_force_n stays at exactly {load_n[600]:.6g} N from row 601 to row 1100 while" in finding.text
        assert finding.text.endswith("; the load cell or its amplifier was stuck; cut the log there")


@pytest.mark.parametrize(
    ("load_n", "words"),
    [
        (0.0, "at 0 N); the load cell is idle, stuck or not connected"),
        (4218.0, "at 4218 N); right for a constant weight; a load cell would be stuck, as its noise is missing"),
    ],
)
def test_a_constant_load_is_noted_with_the_recording(load_n: float, words: str) -> None:
    metadata = replace(METADATA, repairs=("a gap was bridged",))
    recording = check(forced().assign(load_force_n=load_n), replace(LIMITS, load="measured"), metadata)
    assert recording.metadata.repairs[:2] == ("a gap was bridged", f"load_force_n is constant ({words}")


@given(
    st.lists(st.sampled_from(["pressure_1_pa", "pressure_2_pa", "position_m"]), min_size=1, max_size=3),
    st.floats(-1e9, 1e9),
    st.floats(-1e9, 1e9),
    st.integers(1, 60),
)
def test_any_numbers_pass_or_give_our_own_error(columns: list[str], factor: float, shift: float, rows: int) -> None:
    table = good().iloc[: 20 * rows]
    table = table.assign(**{column: table[column] * factor + shift for column in columns})
    limits = replace(LIMITS, minimum_duration_s=0.1)
    with suppress(RecordingError):
        assert len(check(table, limits)) == len(table)
