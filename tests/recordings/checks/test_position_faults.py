"""Faults of a position sensor are found and named with their time; what lies on either side is used."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.position_faults import position_faults, without_position_faults
from cylinder_friction.recordings.conversion import open_tables, pieces_from
from cylinder_friction.recordings.ingesting import recordings_of
from cylinder_friction.recordings.reading_logs import Logs, find_logs
from cylinder_friction.recordings.recording import Signal
from logger_files import CHANNELS, made_log


def held(x: Array, row: int, rows: int) -> Array:
    return np.concatenate([x[:row], np.full(rows, x[row]), x[row + rows :]])


def shifted(x: Array, row: int, by: float) -> Array:
    return np.concatenate([x[:row], x[row:] + by])


def lost(x: Array, row: int, rows: int) -> Array:
    return np.concatenate([x[:row], np.zeros(rows), x[row + rows :]])


def noisy(x: Array, row: int, by: float) -> Array:
    burst = by * np.random.default_rng(0).normal(size=60)
    return np.concatenate([x[:row], x[row : row + 60] + burst, x[row + 60 :]])


HELD = "holds .* mm from .* to .* s while the piston moves on; left out"
FAULTS: dict[str, tuple[Callable[[Array, int], Array], str]] = {
    "held for 0.5 s": (lambda x, row: held(x, row, 50), HELD),
    "held for long": (lambda x, row: held(x, row, 200), HELD),
    "a step of 8 mm": (lambda x, row: shifted(x, row, 0.008), r"jumps by \+[78].* mm at .* s; split there"),
    "a step of -20 mm": (lambda x, row: shifted(x, row, -0.02), r"jumps by -(19|2\d).* mm at .* s; split there"),
    "another scale": (lambda x, row: np.append(x[:row], 1.1 * x[row:]), r"jumps by \+.* mm at .* s; split there"),
    "5 rows lost": (lambda x, row: lost(x, row, 5), "is disturbed from .* to .* s; left out"),
    "30 rows lost": (lambda x, row: lost(x, row, 30), "is disturbed from .* to .* s; left out"),
    "noise of 5 mm": (lambda x, row: noisy(x, row, 0.005), "is disturbed from .* to .* s; left out"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_and_the_rest_is_used(tmp_path: Path, cylinder: Cylinder, fault: str) -> None:
    change, words = FAULTS[fault]
    log = made_log(8000)
    at = 4000 + int(np.argmax(np.abs(np.gradient(log["x"].rolling(41, center=True).mean()))[4000:4800]))
    changed = log.assign(x=1e3 * change(log["x"].to_numpy() / 1e3, at))
    changed.to_csv(tmp_path / "log.csv", index=False)
    logs = find_logs(tmp_path / "log.csv", CHANNELS, cylinder)
    first, second = recordings_of(logs.files, logs.recipe)
    for each in (first, second):
        assert not isinstance(each, Exception)
    repairs = " | ".join(first.metadata.repairs)  # type: ignore[union-attr]
    assert re.search(words, repairs), repairs
    assert len(first) + len(second) > 7600  # type: ignore[arg-type]


def test_single_samples_that_are_off_split_nothing(tmp_path: Path, cylinder: Cylinder) -> None:
    log = made_log(8000)
    rows = np.array([2000, 2600, 2601, 3300, 4000, 5500])
    log.loc[rows, "x"] += np.array([3.0, -3.0, -3.0, 3.0, -3.0, 3.0])  # below what a spike of the screening is [mm]
    faults = position_faults(log["x"].to_numpy() / 1e3, log["t"].to_numpy(), 0.25)
    assert np.concatenate([np.arange(each.begin, each.end) for each in faults]).tolist() == rows.tolist()
    log.to_csv(tmp_path / "log.csv", index=False)
    logs = find_logs(tmp_path / "log.csv", CHANNELS, cylinder)
    (whole,) = recordings_of(logs.files, logs.recipe)
    assert not isinstance(whole, Exception)
    assert len(whole) == 8000  # type: ignore[arg-type]
    repairs = " | ".join(whole.metadata.repairs)  # type: ignore[union-attr]
    # The screening has taken the one at the end of a stroke.
    assert "position_m: 5 single samples that no piston can follow left out (first at 10.00 s)" in repairs


def test_a_sensor_with_many_faults_is_described_in_few_sentences() -> None:
    log = made_log(8000)
    x = log["x"].to_numpy() / 1e3
    for row in range(500, 7500, 500):
        x = lost(x, row, 5)
    signals = {"position_m": Signal(log["t"].to_numpy(), x)}
    _, sentences = without_position_faults(signals, 0.25)
    assert len(sentences) == 6
    assert sentences[-1] == "position_m: 9 more faults, the last at 34.99 s; left out"


def test_a_sound_position_has_no_fault() -> None:
    log = made_log(8000)
    assert position_faults(log["x"].to_numpy() / 1e3, log["t"].to_numpy(), 0.25) == []
    time_s = 0.005 * np.arange(2000)
    stopped = np.clip(0.1 * time_s, 0.2, 0.6)  # hits a stop at 100 mm/s
    assert position_faults(stopped, time_s, 0.85) == []
    resting = np.full(2000, 0.3)
    resting[1000:] += np.clip(0.02 * (time_s[1000:] - 5.0), 0.0, 0.05)  # a coarse converter, then motion
    assert position_faults(np.round(resting, 4), time_s, 0.25) == []


def test_a_sensor_at_the_end_of_its_range_is_not_held_for_lack_of_noise() -> None:
    noise_m = np.random.default_rng(0).normal(0.0, 2e-5, 4000)
    time_s = 0.005 * np.arange(len(noise_m))
    for at_end_m, held in ((0.25, False), (0.1, True)):
        position_m = np.minimum(np.clip(0.05 * (time_s - 5.0), 0.02, at_end_m + 0.01) + noise_m, at_end_m)
        found = [each.words for each in position_faults(position_m, time_s, 0.25)]
        assert any("without the noise" in words for words in found) == held


def test_a_step_in_fast_motion_is_no_single_sample() -> None:
    time_s = 0.01 * np.arange(2000)
    x = 0.4 + 0.15 * np.sin(5.0 * time_s) + np.random.default_rng(0).normal(0.0, 1e-5, 2000)
    (fault,) = position_faults(shifted(x, 950, 0.008), time_s, 0.85)
    assert 945 <= fault.begin <= 951
    assert "jumps by +" in fault.words


@pytest.mark.extended
def test_faults_in_recordings_of_a_crane(crane_logs: Logs) -> None:
    """64 faults, in eight recordings where the jib is fastest: all found, 62 by kind; none in eleven untouched ones."""
    assert len(crane_logs.files) == 11
    found = named = 0
    for name, path in crane_logs.files.items():
        (table,) = open_tables(path, crane_logs.recipe)
        x = table.channels["JibPistonPosition"].to_numpy(dtype=np.float64)
        (untouched,) = pieces_from([table], crane_logs.recipe)
        assert not [words for words in untouched.repairs if "position_m" in words], name
        if name.startswith("Main"):
            continue  # the jib stands
        speed = np.abs(np.gradient(np.convolve(np.nan_to_num(x), np.full(41, 1.0 / 41.0), mode="same")))
        row = len(x) // 4 + int(np.argmax(speed[len(x) // 4 : 4 * len(x) // 5]))
        for change, words in FAULTS.values():
            faulty = replace(table, channels=table.channels.assign(JibPistonPosition=change(x, row)))
            repairs = " | ".join(pieces_from([faulty], crane_logs.recipe)[0].repairs)
            found += "position_m" in repairs
            named += bool(re.search(words, repairs))
    assert found == 64
    assert named >= 62
