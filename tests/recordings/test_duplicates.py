import numpy as np
import pytest

from cylinder_friction.recordings.ingesting import SeenRecordings, samples_hash
from cylinder_friction.recordings.recording import RecordingError


def columns(seed: int = 0, rows: int = 2000) -> dict[str, np.ndarray]:
    noise = np.random.default_rng(seed).normal(size=(3, rows))
    names = {"pressure_1_pa": 20e5, "pressure_2_pa": 9e5, "position_m": 0.1}
    return {name: size * (1.0 + 1e-3 * each) for (name, size), each in zip(names.items(), noise, strict=True)}


def psi(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the table as read from a file in psi and inches."""
    scale = {"pressure_1_pa": 6894.757, "pressure_2_pa": 6894.757, "position_m": 0.0254}
    return {name: values / scale[name] * scale[name] for name, values in table.items()}


def test_the_same_samples_are_a_copy_in_any_unit() -> None:
    seen = SeenRecordings()
    for seed in range(20):
        seen.refuse(f"recording{seed}", f"{seed}.csv", samples_hash(columns(seed)))
    words = r"holds the same samples as recording 'recording7' of 7\.csv; a copy would be counted twice, .*; keep one"
    with pytest.raises(RecordingError, match=words):
        seen.refuse("again", "again.mat", samples_hash(psi(columns(7))))
    with pytest.raises(RecordingError, match=r"has the name 'recording3', which 3\.csv has already"):
        seen.refuse("recording3", "other.csv", samples_hash(columns(99)))
    force = {"drive_force_n": columns(1)["pressure_1_pa"], "position_m": columns(1)["position_m"]}
    seen.refuse("force", "force.csv", samples_hash(force))
    with pytest.raises(RecordingError, match="the same samples as recording 'force'"):
        seen.refuse("force again", "again.csv", samples_hash(force))
