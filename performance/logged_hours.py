"""Hours of a logger's recordings as Parquet files, in seconds, bar and millimetres, for benchmarks.

A few recordings of the simulated rig, without its sensors, are played again and again: each time from another
moment, a little faster or slower, with other gains, other noise, and 12 bits of a converter. No two are alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cylinder_friction.rig.campaign import CampaignPlan, campaign

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.cylinder import Cylinder


RATE_HZ = 200
SESSIONS = 10
BASES = 6
BLEND_S = 2.0
BITS = 12
PRESSURE_SPAN_BAR, PRESSURE_NOISE_BAR = 250.0, 0.05
POSITION_SPAN_MM, POSITION_NOISE_MM = 250.0, 0.03
PRESSURES_AND_POSITION = ("pressure_1_pa", "pressure_2_pa", "position_m")


def write_logs(folder: Path, hours: float, minutes: float, cylinder: Cylinder) -> int:
    """Write ``condition1_session<NN>_recording<NNN>.parquet`` files and returns how many rows they hold in all."""
    folder.mkdir(parents=True)
    count = max(round(hours * 60.0 / minutes), 3)
    rows = round(minutes * 60 * RATE_HZ)
    bases = [_true_signals(cylinder, seed, minutes * 60.0 * 1.1 + BLEND_S) for seed in range(min(BASES, count))]
    for number in range(count):
        name = f"condition1_session{number % SESSIONS:02d}_recording{number:03d}"
        log = _played(bases[number % len(bases)], rows, np.random.default_rng(number))
        log.to_parquet(folder / f"{name}.parquet", index=False)
    return count * rows


def _true_signals(cylinder: Cylinder, seed: int, duration_s: float) -> Array:
    """Return pressures [bar] and position [mm] of one recording whose end runs into its start, shape ``(n, 3)``."""
    plan = CampaignPlan(
        seed=seed, sessions_per_condition=1, recordings_per_session=1, duration_s=float(np.ceil(duration_s))
    )
    truth = next(campaign(cylinder, plan)).truth[list(PRESSURES_AND_POSITION)].to_numpy() * [1e-5, 1e-5, 1e3]
    blended = round(BLEND_S * RATE_HZ)
    share = np.linspace(0.0, 1.0, blended)[:, None]
    seam = (1.0 - share) * truth[-blended:] + share * truth[:blended]
    return np.concatenate([truth[blended:-blended], seam])


def _played(base: Array, rows: int, generator: np.random.Generator) -> pd.DataFrame:
    place = generator.integers(len(base)) + generator.uniform(0.9, 1.1) * np.arange(rows)
    columns = {"Time [s]": np.round(np.arange(rows) / RATE_HZ, 3)}
    for index, (channel, span, noise) in enumerate(
        (
            ("P1 [bar]", PRESSURE_SPAN_BAR, PRESSURE_NOISE_BAR),
            ("P2 [bar]", PRESSURE_SPAN_BAR, PRESSURE_NOISE_BAR),
            ("Position [mm]", POSITION_SPAN_MM, POSITION_NOISE_MM),
        )
    ):
        true = np.interp(place, np.arange(len(base)), base[:, index], period=len(base))
        seen = true * generator.uniform(0.985, 0.995) + generator.normal(0.0, noise, rows)
        step = span / 2**BITS
        columns[channel] = np.round(np.round(np.clip(seen, -0.01 * span, span) / step) * step, 3)
    return pd.DataFrame(columns)
