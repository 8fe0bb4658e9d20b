from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.checks.duplicate_detection import DuplicateDetection, window_hashes


def made(seed: int, rows: int = 8000, noise_pa: float = 5e3) -> pd.DataFrame:
    """The same programme of sines every time; only the sensors' noise differs."""
    generator = np.random.default_rng(seed)
    time_s = 0.005 * np.arange(rows)
    return pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": 20e5 + 8e5 * np.sin(1.3 * time_s) + generator.normal(0.0, noise_pa, rows),
            "pressure_2_pa": 25e5 + 10e5 * np.sin(1.3 * time_s) + generator.normal(0.0, noise_pa, rows),
            "position_m": 0.12 + 0.1 * np.sin(0.7 * time_s) + generator.normal(0.0, 3e-5, rows),
        }
    )


def as_logged(table: pd.DataFrame, pressure_unit_pa: float, decimals: int) -> pd.DataFrame:
    """Export again: pressures in a unit with so many decimals, position in mm with three."""
    pressures = (table[["pressure_1_pa", "pressure_2_pa"]] / pressure_unit_pa).round(decimals) * pressure_unit_pa
    return table.assign(**pressures, position_m=np.round(table["position_m"] * 1e3, 3) / 1e3)


@pytest.mark.parametrize(
    ("again", "least_share"),
    [
        (lambda table: table, 1.0),
        (lambda table: as_logged(table, 1e5, 2), 0.4),
        (lambda table: as_logged(table, 6894.757, 2), 0.7),  # psi
        (lambda table: table.astype(np.float32).astype(np.float64), 0.9),
        (lambda table: table.assign(time_s=table["time_s"] + 3600.0), 1.0),
        (lambda table: table.iloc[1000:3000], 0.9),
        (lambda table: as_logged(table.iloc[len(table) // 2 :], 1e5, 3), 0.8),
        (lambda table: pd.concat([made(99), table.iloc[: len(table) // 2]]), 0.3),  # joined to something new
    ],
)
def test_the_same_measurement_is_known_again(
    rig_tables: dict[str, pd.DataFrame], again: Callable[[pd.DataFrame], pd.DataFrame], least_share: float
) -> None:
    seen = DuplicateDetection()
    tables = {**rig_tables, "made": made(1)}
    for name, table in tables.items():
        assert seen.add(name, window_hashes(table)) is None
    for name, table in tables.items():
        match = seen.add("again", window_hashes(again(table)))
        assert match is not None
        assert match.name == name
        assert match.share >= least_share


@pytest.mark.parametrize("noise_pa", [500.0, 5e3, 5e4])
def test_a_repeated_programme_is_not_a_repeated_measurement(noise_pa: float) -> None:
    seen = DuplicateDetection()
    for seed in range(20):
        assert seen.add(str(seed), window_hashes(made(seed, noise_pa=noise_pa))) is None


def test_a_drive_force_is_known_again() -> None:
    def forced(seed: int) -> pd.DataFrame:
        table = made(seed)
        force = 500.0 * np.sin(0.7 * table["time_s"]) + np.random.default_rng(seed).normal(0.0, 3.0, len(table))
        return table[["position_m"]].assign(drive_force_n=force)

    seen = DuplicateDetection()
    assert [seen.add(str(seed), window_hashes(forced(seed))) for seed in range(5)] == [None] * 5
    assert seen.add("again", window_hashes(forced(3).round({"drive_force_n": 1}).iloc[700:])) is not None


@pytest.mark.parametrize("table", [made(0, rows=0), made(0, rows=30), made(0).assign(position_m=0.1), made(0) * 0.0])
def test_what_says_nothing_matches_nothing(table: pd.DataFrame) -> None:
    seen = DuplicateDetection()
    assert [seen.add(name, window_hashes(table)) for name in "ab"] == [None, None]


def test_each_of_many_recordings_is_known_again_also_of_an_earlier_run() -> None:
    hashed = {str(seed): window_hashes(made(seed, rows=2000)) for seed in range(30)}
    one, other = DuplicateDetection(), DuplicateDetection()
    assert [one.add(name, own) for name, own in hashed.items()] == [None] * len(hashed)
    other.remember((name, name, name, own) for name, own in hashed.items())
    for name, own in hashed.items():
        assert [each.add("again", own) for each in (one, other)] == [(name, 1.0)] * 2
