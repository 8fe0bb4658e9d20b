"""Faults that a sensor, a wire or a logger puts into a recording are named with their place, or the log is refused."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.recording_checks import check_position_steps
from cylinder_friction.recordings.conversion import Quarantined, recordings_of
from cylinder_friction.recordings.logs import find_logs
from logger_files import STATED, made_log

ROWS, LEAST_NAMED = 8000, 28


def held(x: Array, row: int, rows: int) -> Array:
    return np.concatenate([x[:row], np.full(rows, x[row]), x[row + rows :]])


def shifted(x: Array, row: int, by: float) -> Array:
    return np.concatenate([x[:row], x[row:] + by])


def lost(x: Array, row: int, rows: int) -> Array:
    return np.concatenate([x[:row], np.zeros(rows), x[row + rows :]])


def noisy(x: Array, row: int, by: float) -> Array:
    burst = by * np.random.default_rng(0).normal(size=60)
    return np.concatenate([x[:row], x[row : row + 60] + burst, x[row + 60 :]])


HELD = "holds .* mm from .* to .* s while the piston moves on, in row "
POSITION: dict[str, tuple[Callable[[Array, int], Array], str]] = {
    "held for 0.5 s": (lambda x, row: held(x, row, 50), HELD),
    "held for long": (lambda x, row: held(x, row, 200), HELD),
    "a step of 8 mm": (lambda x, row: shifted(x, row, 0.008), r"jumps by \+[78].* mm at .* s, and on one side"),
    "a step of -20 mm": (lambda x, row: shifted(x, row, -0.02), r"jumps by -(19|2\d).* mm at .* s, and on one side"),
    "another scale": (lambda x, row: np.append(x[:row], 1.1 * x[row:]), r"jumps by \+.* mm at .* s, and on one side"),
    "5 rows lost": (lambda x, row: lost(x, row, 5), "is disturbed from .* to .* s, in row "),
    "30 rows lost": (lambda x, row: lost(x, row, 30), "is disturbed from .* to .* s, in row "),
    "noise of 5 mm": (lambda x, row: noisy(x, row, 0.005), "is disturbed from .* to .* s, in row "),
}
Change = Callable[[pd.DataFrame], pd.DataFrame]


def values(column: str, rows: slice | int, value: float) -> Change:
    def change(log: pd.DataFrame) -> pd.DataFrame:
        log.loc[log.index[rows], column] = value
        return log

    return change


OTHERS: dict[str, tuple[Change, str]] = {
    "piston-side pressure stuck": (values("p1", slice(3000, 6000), 9.5), "pressure_1_pa stays at exactly 950000 Pa"),
    "rod-side pressure stuck": (values("p2", slice(1000, 6000), 8.0), "pressure_2_pa stays at exactly 800000 Pa from"),
    "broken wire": (values("p2", slice(1000, ROWS), -62.5), "pressure_2_pa is -62.5 bar in row 1001"),
    "saturated": (values("p1", slice(1000, 2000), 250.0), "pressure_1_pa is 250 bar in row 1001 .* saturated"),
    "a spike": (values("p1", 1234, 180.0), "pressure_1_pa is 180 bar in row 1235 .* a spike"),
    "an overflow": (values("p1", 1234, np.inf), "pressure_1_pa is inf in row 1235"),
    "pressures exchanged": (lambda log: log.rename(columns={"p1": "p2", "p2": "p1"}), "the pressures are swapped"),
    "one channel twice": (lambda log: log.assign(p2=log["p1"]), "equal in every row"),
    "MPa": (lambda log: log.assign(p1=0.1 * log["p1"], p2=0.1 * log["p2"]), "MPa read as bar"),
    "position inverted": (lambda log: log.assign(x=250.0 - log["x"]), "position_m is inverted"),
    "rows exchanged": (lambda log: log.iloc[[*range(100), 101, 100, *range(102, ROWS)]], "goes back in row 102, from"),
    "a wild stamp": (values("t", 500, 9e9), "time_s goes back in row 502"),
    "a second lost": (lambda log: log.drop(index=range(2000, 2200)), "split at 1 gap of more than 2 lost samples"),
    "the clock restarts": (lambda log: log.assign(t=log["t"] % 20.0), "split at 1 restart of the clock"),
}


def fastest(x: Array, first: int, last: int) -> int:
    speed = np.abs(np.gradient(np.convolve(np.nan_to_num(x), np.full(41, 1.0 / 41.0), mode="same")))
    return first + int(np.argmax(speed[first:last]))


def told(log: pd.DataFrame, folder: Path, cylinder: Cylinder) -> str:
    """Return what is repaired, noted or refused of a log."""
    log.to_csv(folder / "log.csv", index=False)
    outcomes = recordings_of(find_logs(folder / "log.csv", STATED, cylinder))
    return " | ".join(
        each.reason if isinstance(each, Quarantined) else " | ".join(each.metadata.repairs) for each in outcomes
    )


def test_thirty_faults_are_named(tmp_path: Path, cylinder: Cylinder, capsys: pytest.CaptureFixture[str]) -> None:
    assert told(made_log(ROWS), tmp_path, cylinder) == ""
    x = made_log(ROWS)["x"].to_numpy() / 1e3
    places = fastest(x, 2000, 2800), fastest(x, 4000, 4800)
    faults = [(name, lambda log, c=change, r=row: log.assign(x=1e3 * c(x, r)), words)
              for row in places for name, (change, words) in POSITION.items()]  # fmt: skip
    faults += [(name, change, words) for name, (change, words) in OTHERS.items()]
    unnamed = [name for name, change, words in faults if not re.search(words, told(change(made_log(ROWS)), tmp_path, cylinder))]  # fmt: skip  # noqa: E501
    with capsys.disabled():
        sys.stdout.write(f"{len(faults) - len(unnamed)} of {len(faults)} faults named; not: {unnamed}\n")
    assert len(faults) == 30
    assert len(faults) - len(unnamed) >= LEAST_NAMED


TIME_S = 0.005 * np.arange(6000)
STROKES_M = 0.125 + 0.05 * np.sin(0.4 * np.pi * TIME_S)
RESTED_M = np.where(TIME_S < 10.0, 0.125, STROKES_M)
NOISE = np.random.default_rng(1).normal(size=6000)
NOISE_M, BURST_M = 2e-5 * NOISE, 2e-5 * NOISE * (abs(TIME_S - 15.0) < 5.0)
SINGLE = np.isin(np.arange(6000), [2000, 2600, 2601, 3300, 4000]) * np.where(TIME_S < 12.0, 0.003, -0.003)
RESTING = np.round(0.3 + np.clip(0.02 * (TIME_S - 5.0), 0.0, 0.05), 4)  # a coarse converter, then motion


def ended(at_m: float) -> Array:
    """Drive a sensor with noise against the end of its range."""
    return np.minimum(np.clip(0.05 * (TIME_S - 5.0), 0.02, at_m + 0.01) + 2e-5 * NOISE, at_m)


@pytest.mark.parametrize(
    ("position_m", "stroke_m", "outcome", "words"),
    [
        (made_log(6000)["x"].to_numpy() / 1e3, 0.25, "ok", ""),
        (np.clip(0.1 * TIME_S, 0.2, 0.6), 0.85, "ok", ""),  # hits a stop at 100 mm/s
        (RESTING, 0.25, "ok", ""),
        (STROKES_M + 3e-5 * NOISE + SINGLE, 0.25, "noted", r"4 single samples .* \(first: row 2000, at 10.00 s\)"),
        (ended(0.25), 0.25, "ok", ""),
        (ended(0.1), 0.25, "noted", "holds 100 mm from .* without the noise"),
        (STROKES_M + 0.001 * (TIME_S >= 5.0), 0.25, "noted", r"jumps by \+1.01 mm at 5.00 s"),
        (STROKES_M + 0.005 * (TIME_S >= 5.0), 0.25, "refused", r"jumps by \+5.01 mm at 5.00 s"),
        (STROKES_M + NOISE_M + 59.0 * BURST_M, 0.25, "noted", "noise between 10.00 and 20.00 s"),
        (STROKES_M + NOISE_M + 2.0 * BURST_M, 0.25, "ok", ""),
        (np.repeat((RESTED_M + NOISE_M)[::2], 2), 0.25, "noted", "new value in 50 % .* so it is late by about 2.5 ms"),
        (5e-4 * np.floor(np.cumsum(np.where(TIME_S < 15.0, 1.0, 0.5))), 1.0, "ok", ""),  # coarse: each row, each other
    ],
    ids=["sound", "stop", "coarse", "single", "end", "held", "step", "jump", "noise", "little", "slower", "coarser"],
)
def test_faults_of_the_position_are_weighed(position_m: Array, stroke_m: float, outcome: str, words: str) -> None:
    found = check_position_steps(position_m, TIME_S, stroke_m)
    assert [each.outcome for each in found] == ([] if outcome == "ok" else [outcome])
    assert all(re.search(words, each.text) for each in found)
