"""Logger files of known recordings, and of strokes whose friction is a known LuGre model."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.friction_models.lugre import LugreParameters
from cylinder_friction.recordings.recording import Recording
from friction_samples import new_bristle, simulate

CHANNELS: dict[str, Any] = {
    "time_s": {"channel": "t", "unit": "s"},
    "pressure_1_pa": {"channel": "p1", "unit": "bar"},
    "pressure_2_pa": {"channel": "p2", "unit": "bar"},
    "position_m": {"channel": "x", "unit": "mm"},
}
SENSOR = {
    "accuracy_percent": 0.05,
    "zero_uncertainty": 0.05,
    "zeroed": "each session",
    "range": [0.0, 250.0],
    "unit": "bar",
}
STATED = CHANNELS | {name: CHANNELS[name] | {"sensor": SENSOR} for name in ("pressure_1_pa", "pressure_2_pa")}
SAMPLE_TIME_S = 0.005
FINE = 20


def columns_of(table: pd.DataFrame) -> dict[str, Array]:
    """Return the columns of a table as the checks of a recording take them."""
    return {str(name): table[name].to_numpy(dtype=np.float64) for name in table}


def write_log(path: Path, recording: Recording, zero_bar: float = 0.0) -> Path:
    """Write raw columns as ``CHANNELS`` maps them; ``zero_bar`` is an offset of the first pressure sensor."""
    names = ("time_s", "pressure_1_pa", "pressure_2_pa", "position_m")
    time_s, first_pa, second_pa, position_m = (recording.column(name) for name in names)
    return _write(path, time_s, first_pa, second_pa, position_m, zero_bar)


def made_log(rows: int) -> pd.DataFrame:
    """Return strokes of changing speed with noise, 200 Hz, in the units of ``CHANNELS``."""
    generator, time_s = np.random.default_rng(1), np.arange(rows) / 200.0
    phase = 1.1 * time_s + 3.0 * np.sin(0.02 * time_s)
    friction_n = 300.0 * np.tanh(20.0 * np.cos(phase))
    second_bar = 9.0 + 2.0 * np.sin(0.3 * time_s)
    first_bar = (friction_n + 1e5 * second_bar * 0.0025) / 0.0031 / 1e5
    return pd.DataFrame(
        {
            "t": np.round(time_s, 3),
            "p1": np.round(first_bar + generator.normal(0.0, 0.05, rows), 3),
            "p2": np.round(second_bar + generator.normal(0.0, 0.05, rows), 3),
            "x": np.round(125.0 + 30.0 * np.sin(phase) + generator.normal(0.0, 0.03, rows), 3),
        }
    )


def write_lugre_log(
    path: Path,
    truth: LugreParameters,
    cylinder: Cylinder,
    speeds_m_s: Sequence[float],
    ways: Sequence[float] = (1.0, -1.0),
    pressure_2_pa: tuple[float, float] = (1e6, 5e5),
    load_n: float = 0.0,
    seed: int = 0,
) -> Path:
    """Write strokes of a second at each speed in each way, with pauses; friction is simulated at 4 kHz.

    Args:
        path: Of the file.
        truth: The friction.
        cylinder: Areas and mass.
        speeds_m_s, ways: Of the strokes, from the middle of the travel; ways are 1 (extending) or -1.
        pressure_2_pa: Mean and amplitude of the pressure on the rod side [Pa].
        load_n: A constant force against extension [N].
        seed: Of noise and of the pressure's phase.
    """
    fine_s, generator = SAMPLE_TIME_S / FINE, np.random.default_rng(seed)
    held, pause = np.ones(round(1.0 / fine_s)), np.zeros(round(0.3 / fine_s))
    targets = [np.concatenate([way * speed * held, pause]) for speed in speeds_m_s for way in ways]
    window = np.hanning(round(0.1 / fine_s))
    fine = np.convolve(np.concatenate([pause, *targets]), window / window.sum(), mode="same")
    velocity, position = fine[FINE - 1 :: FINE], (np.cumsum(fine) * fine_s)[FINE - 1 :: FINE]
    time_s = SAMPLE_TIME_S * np.arange(len(velocity))
    second = pressure_2_pa[0] + pressure_2_pa[1] * np.sin(0.7 * time_s + seed)
    others_n = (
        load_n + second * cylinder.annulus_area_m2 + cylinder.moving_mass_kg * np.gradient(velocity, SAMPLE_TIME_S)
    )
    first = others_n / cylinder.piston_area_m2
    for _ in range(5):  # friction depends on the pressure that overcomes it
        sums = np.repeat(first + second, FINE)
        friction = simulate(truth, fine, fine_s, new_bristle(), sums)[FINE - 1 :: FINE]
        first = (others_n + friction) / cylinder.piston_area_m2
    noise_pa = generator.normal(0.0, 2e3, len(first))
    middle_m = 0.5 * (cylinder.stroke_m - position.max() - position.min())
    return _write(path, time_s, first + noise_pa, second, middle_m + position + generator.normal(0.0, 1e-6, len(first)))


def _write(
    path: Path,
    time_s: np.ndarray,
    first_pa: np.ndarray,
    second_pa: np.ndarray,
    position_m: np.ndarray,
    zero_bar: float = 0.0,
) -> Path:
    table = pd.DataFrame({"t": time_s, "p1": first_pa / 1e5 + zero_bar, "p2": second_pa / 1e5, "x": 1e3 * position_m})
    path.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, index=False)
    return path
