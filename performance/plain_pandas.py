"""Ingest, filter and label as a person writes them for one logger, with pandas and SciPy: what the stages are held to.

Each function reads one folder, one recording at a time, and writes the next, as the stages do.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import pandas as pd
from scipy.signal import savgol_filter

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder

MARGIN_M = 0.003
WINDOW = 41


def ingest(source: Path, into: Path, cylinder: Cylinder) -> None:
    """Log in bar and millimetres to recordings in SI; what is wrong is listed."""
    into.mkdir(parents=True)
    seen: set[str] = set()
    refused = {}
    for path in sorted(source.glob("*.parquet")):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        log = pd.read_parquet(path)
        table = pd.DataFrame(
            {
                "time_s": log["Time [s]"],
                "pressure_1_pa": log["P1 [bar]"] * 1e5,
                "pressure_2_pa": log["P2 [bar]"] * 1e5,
                "position_m": log["Position [mm]"] * 1e-3,
            }
        )
        problem = "a copy" if digest in seen else what_is_wrong(table, cylinder.stroke_m)
        seen.add(digest)
        if problem:
            refused[path.name] = problem
        else:
            table.to_parquet(into / path.name, index=False)
    pd.Series(refused, dtype=object).to_json(into / "refused.json")


def what_is_wrong(table: pd.DataFrame, stroke_m: float) -> str:
    """Return the first problem of a recording, or nothing."""
    if table.isna().any().any():
        return "values are missing"
    steps = table["time_s"].diff().dropna()
    if (steps <= 0.0).any() or ((steps - steps.median()).abs() > 0.2 * steps.median()).any():
        return "time is uneven"
    if len(table) * steps.median() < 5.0:
        return "too short"
    position = table["position_m"]
    if not position.between(-0.05 * stroke_m, 1.05 * stroke_m).all() or position.max() - position.min() < 0.0025:
        return "position is wrong"
    for column in ("pressure_1_pa", "pressure_2_pa"):
        pressure = table[column]
        if not pressure.between(-2e5, 7e7).all() or pressure.max() - pressure.min() < 1e3:
            return f"{column} is wrong"
        held = position.groupby((pressure.diff() != 0.0).cumsum())
        if (held.max() - held.min()).max() > 0.25 * stroke_m:
            return f"{column} is stuck"
    return ""


def smooth(source: Path, into: Path) -> None:
    """Recordings to smooth signals."""
    into.mkdir(parents=True)
    for path in sorted(source.glob("*.parquet")):
        table = pd.read_parquet(path)
        step_s = table["time_s"].diff().median()
        table["pressure_1_smooth_pa"] = savgol_filter(table["pressure_1_pa"], 11, 2)
        table["pressure_2_smooth_pa"] = savgol_filter(table["pressure_2_pa"], 11, 2)
        table["velocity_m_s"] = savgol_filter(table["position_m"], 21, 3, deriv=1, delta=step_s)
        table["acceleration_m_s2"] = savgol_filter(table["position_m"], WINDOW, 3, deriv=2, delta=step_s)
        table.to_parquet(into / path.name, index=False)


def label(source: Path, into: Path, cylinder: Cylinder) -> None:
    """Smooth signals to friction and usable rows, in a folder each for training, validation and test."""
    paths = sorted(source.glob("*.parquet"))
    sessions = sorted({session_of(path) for path in paths})
    roles = {sessions[0]: "test", sessions[1]: "validation"}
    for role in ("train", "validation", "test"):
        (into / role).mkdir(parents=True)
    for path in paths:
        table = pd.read_parquet(path)
        table["friction_n"] = (
            table["pressure_1_smooth_pa"] * cylinder.piston_area_m2
            - table["pressure_2_smooth_pa"] * cylinder.annulus_area_m2
            - table["acceleration_m_s2"] * cylinder.moving_mass_kg
        )
        stopped = ~table["position_m"].between(MARGIN_M, cylinder.stroke_m - MARGIN_M, inclusive="neither")
        near_stop = stopped.rolling(WINDOW, center=True, min_periods=1).max() > 0
        table["usable"] = ~near_stop
        table.loc[table.index[: WINDOW // 2], "usable"] = False
        table.loc[table.index[-(WINDOW // 2) :], "usable"] = False
        table.to_parquet(into / roles.get(session_of(path), "train") / path.name, index=False)


def session_of(path: Path) -> str:
    return path.stem.rsplit("_", 1)[0]
