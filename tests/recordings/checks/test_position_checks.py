"""A position that no piston under this force can have is named with its time."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding
from cylinder_friction.recordings.checks.plausibility import clear_motion
from cylinder_friction.recordings.checks.position_checks import check_position_against_force, check_position_steps
from cylinder_friction.recordings.checks.recording_checks import inspect_recording
from cylinder_friction.recordings.conversion import open_tables, pieces_from
from cylinder_friction.recordings.reading_logs import Logs
from logger_files import columns_of

NOISE_M = 2e-5


def strokes(load: Callable[[Array, Array], Array] = lambda x, other: 0.0 * x) -> pd.DataFrame:
    """Return strokes of 100 mm, a rest in the middle of the travel, and 300 N of friction; 60 s at 100 Hz."""
    time_s, generator = 0.01 * np.arange(6000), np.random.default_rng(0)
    moving = time_s < 40.0
    phase = np.where(moving, 0.25 * np.pi * time_s, 10.0 * np.pi)
    x, other = 0.125 + 0.05 * np.sin(phase), 0.3 + 0.1 * np.sin(0.9 * time_s)
    friction_n = 300.0 * np.where(moving, np.tanh(20.0 * np.cos(phase)), 0.2) + generator.normal(0.0, 5.0, len(x))
    return pd.DataFrame(
        {
            "time_s": time_s,
            "position_m": x + generator.normal(0.0, NOISE_M, len(x)),
            "drive_force_n": friction_n + load(x, other),
            "other_position_1_m": other,
        }
    )


def pivoted(x: Array, row: int, times: float) -> Array:
    return np.append(x[:row], x[row] + times * (x[row:] - x[row]))


def wobbly(x: Array, row: int, amplitude_m: float = 0.01) -> Array:
    seconds = 0.01 * (np.arange(len(x)) - row)
    return x + np.where((seconds > 0.0) & (seconds < 6.0), amplitude_m * (1.0 - np.cos(np.pi * seconds)), 0.0)


def still(x: Array, row: int) -> Array:
    return np.append(x[:row], x[row] + np.random.default_rng(1).normal(0.0, NOISE_M, len(x) - row))


def drifting(x: Array, row: int) -> Array:
    return x - 0.01 * np.clip((np.arange(len(x)) - row) / 800.0, 0.0, 1.0)


FAULTS: dict[str, tuple[Callable[[Array], Array], str]] = {
    "loose at rest": (lambda x: wobbly(x, 4500), r"retracts by 1\d mm from 4[67].* to 4[67].* although the force"),
    "loose in motion": (
        lambda x: wobbly(x, 1700, 0.025),
        r"position_m (extends|retracts) by .* from (1[789]|2[0123])\.",
    ),
    "drifts at rest": (lambda x: drifting(x, 4500), r"retracts by (9|10)\.?\d* mm from 4[45].* to 5[23].* although"),
    "runs backwards": (lambda x: pivoted(x, 2200, -1.0), r"position_m (extends|retracts) by .* from 22\..* \(first of"),
}


NO_AREAS = CheckLimits(stroke_m=0.25)


def checked(table: pd.DataFrame, limits: CheckLimits = NO_AREAS) -> Finding:
    columns = columns_of(table)
    step_s = float(columns["time_s"][1] - columns["time_s"][0])
    return check_position_against_force(columns, clear_motion(columns["position_m"], step_s, limits.stroke_m), limits)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_motion_that_the_force_does_not_push_is_named(fault: str) -> None:
    change, words = FAULTS[fault]
    table = strokes()
    table["position_m"] = change(table["position_m"].to_numpy())
    finding = checked(table)
    assert (finding.check, finding.outcome) == ("position_against_force", "noted")
    assert re.search(words, finding.text), finding.text
    assert finding.text.endswith("leave this time out")


def test_a_rest_at_which_no_friction_could_hold_the_piston_is_named() -> None:
    table = strokes(lambda x, _: 20e3 * (x - 0.125))  # 2 kN along the strokes
    table["position_m"] = still(table["position_m"].to_numpy(), 3050)
    finding = checked(table)
    assert re.search(r"rests from 3\d\..* although the force is \d\.?\d* times friction", finding.text), finding.text


@pytest.mark.parametrize(
    "load", [lambda x, _: 0.0 * x, lambda x, _: 4e3 + 20e3 * x, lambda x, other: 4e3 + 20e3 * x - 10e3 * other]
)
def test_a_sound_position_contradicts_nothing(load: Callable[[Array, Array], Array]) -> None:
    finding = checked(strokes(load))
    assert (finding.outcome, finding.text) == ("ok", "position and force do not contradict each other")


def test_a_load_is_not_guessed_where_the_piston_did_not_clearly_move() -> None:
    """After the last stroke the other cylinder moves on, and the load with it."""
    table = strokes(lambda x, _: 4e3 + 0.0 * x)
    far = np.clip(table["time_s"].to_numpy() - 45.0, 0.0, 5.0)
    table["other_position_1_m"] = 0.3 + 0.1 * far
    table["drive_force_n"] += 1e3 * far
    assert checked(table).outcome == "ok"


def test_nothing_is_said_without_a_force_or_where_position_does_not_explain_it(
    rig_tables: dict[str, pd.DataFrame], cylinder: Cylinder
) -> None:
    cannot = "whether position and force contradict each other cannot be decided"
    table = next(iter(rig_tables.values()))
    assert checked(table).text == cannot
    areas = CheckLimits(0.25, cylinder.piston_area_m2, cylinder.annulus_area_m2)
    assert checked(table.iloc[:10], areas).text == cannot
    unstated_n = 5e3 * np.sin(2.0 * table["time_s"])  # a load that no position decides
    loaded = table.assign(pressure_1_pa=table["pressure_1_pa"] + unstated_n / cylinder.piston_area_m2)
    assert checked(loaded, areas).text == cannot


@pytest.mark.extended
def test_faults_that_no_single_sample_shows_in_recordings_of_a_crane(crane_logs: Logs) -> None:
    """Of 40, 23 show in the force and 8 in the noise; eleven untouched recordings show none."""

    def names(x: Array | None, path: Path) -> bool:
        (table,) = open_tables(path, crane_logs.recipe)
        if x is not None:
            table = replace(table, channels=table.channels.assign(JibPistonPosition=x))
        pieces = pieces_from([table], crane_logs.recipe)
        findings = [
            finding
            for piece in pieces
            for finding in inspect_recording(piece.columns, crane_logs.recipe.limits, piece.sample_time_s)
        ]
        return any(each.check.startswith("position_") and each.outcome != "ok" for each in findings)

    found = dict.fromkeys(("still", "loose at rest", "loose in motion", "backwards", "drifts"), 0)
    for name, path in crane_logs.files.items():
        assert not names(None, path), name
        if name.startswith("Main"):
            continue  # the jib stands
        (table,) = open_tables(path, crane_logs.recipe)
        x = table.channels["JibPistonPosition"].to_numpy(dtype=np.float64)
        speed = np.abs(np.gradient(np.convolve(np.nan_to_num(x), np.full(41, 1.0 / 41.0), mode="same")))
        row = len(x) // 4 + int(np.argmax(speed[len(x) // 4 : 4 * len(x) // 5]))
        changed = np.append(x[:row], np.full(len(x) - row, x[row])), wobbly(x, len(x) - 800), wobbly(x, row)
        for kind, each in zip(found, (*changed, pivoted(x, row, -1.0), drifting(x, len(x) - 1000)), strict=True):
            found[kind] += names(each, path)
    assert found["still"] == 8
    assert sum(found.values()) >= 29, found


def test_a_small_jump_is_noted_and_a_large_one_refuses_the_recording() -> None:
    time_s = 0.005 * np.arange(2000)
    position_m = 0.12 + 0.05 * np.sin(time_s)
    for height_m, outcome in ((0.001, "noted"), (0.005, "refused")):
        found = check_position_steps(position_m + height_m * (time_s >= 5.0), time_s, stroke_m=0.25)
        assert found.outcome == outcome
        assert f"jumps by +{1e3 * height_m:.0f} mm at 5" in found.text.replace(".00 mm", " mm")


@pytest.mark.parametrize(("times", "outcome"), [(60.0, "noted"), (3.0, "ok")])
def test_noise_of_a_third_of_a_recording_is_compared_with_the_quietest_stretch(times: float, outcome: str) -> None:
    recording, generator = strokes(), np.random.default_rng(1)
    position_m, time_s = recording["position_m"].to_numpy().copy(), recording["time_s"].to_numpy()
    position_m[2000:4000] += generator.normal(0.0, times * NOISE_M, 2000)
    found = check_position_steps(position_m, time_s, stroke_m=0.25)
    assert found.outcome == outcome
    assert outcome == "ok" or re.search(r"noise between (19|20)\.\d+ and (39|40)\.\d+ s", found.text)
