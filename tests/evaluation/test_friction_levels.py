"""What a difference of friction between recordings comes from, and what is left of it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.evaluation.friction_levels import differences, friction_levels, in_words
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction.reporting.friction_page import level_tables


def strokes(name: str, pressure_bar: float, more_n: float = 0.0, fastest_mm_s: float = 40.0) -> Recording:
    """Return strokes out and in at five speeds; friction is 300 N, 4 N per bar and 2 N per mm/s, and ``more_n``."""
    speeds = np.geomspace(3.0, fastest_mm_s, 5)
    velocity = np.repeat(np.concatenate([[each, -each] for each in speeds]), 400) * 1e-3
    noise = np.random.default_rng(len(name)).normal(0.0, 4.0, len(velocity))
    friction_n = np.sign(velocity) * (300.0 + 4.0 * pressure_bar + 2e3 * np.abs(velocity) + more_n) + noise
    table = {
        "time_s": 0.01 * np.arange(len(velocity)),
        "pressure_1_pa": 0.6e5 * pressure_bar,
        "pressure_2_pa": 0.4e5 * pressure_bar,
        "position_m": 0.1 + 0.01 * np.cumsum(velocity),
        "velocity_m_s": velocity,
        "friction_n": friction_n,
        "usable": True,
    }
    return Recording(RecordingMetadata(name, "1", name, 0.01), pd.DataFrame(table))


def compared(*recordings: Recording):  # type: ignore[no-untyped-def]
    return {each.name: each for each in differences({one.name: friction_levels([one]) for one in recordings})}


def test_levels_hold_the_mean_friction_against_the_motion() -> None:
    levels = friction_levels([strokes("a", 40.0)])
    assert {each.direction for each in levels} == {1, -1}
    assert {each.pressure_bar for each in levels} == {25.0}
    slow = [each for each in levels if each.speed_mm_s == 2.0]
    assert len(slow) == 2
    for each in slow:
        assert each.friction_n == pytest.approx(300.0 + 160.0 + 6.0, abs=2.0)


def test_pressure_explains_a_difference_and_nothing_is_left() -> None:
    found = compared(strokes("a", 40.0), strokes("b", 42.0), strokes("c", 130.0), strokes("d", 132.0))
    assert found["c"].differs_n == pytest.approx(352.0, abs=20.0)
    assert abs(found["c"].left_n["pressures"]) < 20.0
    assert found["c"].left_n["speed"] == pytest.approx(352.0, abs=20.0)
    assert abs(found["c"].equal.newtons) < 12.0


def test_what_neither_pressure_nor_speed_explains_is_left() -> None:
    recordings = [strokes("a", 40.0), strokes("bb", 40.0, fastest_mm_s=20.0), strokes("ccc", 40.0, more_n=90.0)]
    found = compared(*recordings)
    assert found["ccc"].equal.newtons == pytest.approx(90.0, abs=10.0)
    assert found["ccc"].equal.is_unexplained
    words = in_words(list(found.values()))
    assert "at equal pressures, speed and direction it differs from the others' for ccc +" in words
    assert words.endswith("position, the oil's temperature, the load or a sensor's zero")
    tables = level_tables(list(found.values()), {each.name: friction_levels([each]) for each in recordings})
    assert [title for title, _, _ in tables] == ["What differs between recordings", "Friction by pressure"]
    assert tables[1][2].rows[2][1].words.startswith("5")


def test_recordings_whose_strokes_scatter_alike_seldom_differ() -> None:
    """Each stroke is off by its own 20 N: of 80 sets of 3 recordings, few recordings may be named."""
    generator, named = np.random.default_rng(0), 0
    for _ in range(80):
        recordings = []
        for name in "abc":
            each = strokes(name, 40.0, fastest_mm_s=6.0)
            off_n = np.repeat(generator.normal(0.0, 20.0, len(each) // 400), 400)
            recordings.append(each.with_columns(friction_n=each.column("friction_n") + off_n))
        found = compared(*recordings).values()
        named += sum(each.equal is not None and each.equal.is_unexplained for each in found)
    assert named <= 0.08 * 80 * 3


def test_the_difference_of_two_recordings_is_stated_once() -> None:
    words = in_words(list(compared(strokes("aaa", 40.0), strokes("bbb", 40.0, 90.0)).values()))
    assert sum(f"{name} {sign}" in words for name, sign in (("aaa", "-"), ("bbb", "+"))) == 1


def test_equal_recordings_agree_and_strangers_are_not_compared() -> None:
    alike = compared(strokes("a", 40.0), strokes("b", 40.0))
    assert in_words(list(alike.values())).endswith("recordings agree within their scatter")
    apart = compared(strokes("a", 40.0), strokes("b", 140.0))
    assert apart["a"].left_n["pressures"] is None
    assert apart["a"].equal is None
    assert in_words(list(apart.values())) == ""
    assert differences({"alone": friction_levels([strokes("a", 40.0)])}) == ()
    assert level_tables((), {}) == []


def test_without_pressures_there_are_no_levels() -> None:
    table = strokes("a", 40.0).table.drop(columns=["pressure_1_pa", "pressure_2_pa"]).assign(drive_force_n=1.0)
    assert friction_levels([Recording(RecordingMetadata("a", "1", "1", 0.01), table)]) == ()
