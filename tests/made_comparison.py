"""An estimator and recordings whose errors can be worked out by hand, and a comparison of them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.evaluation.comparison import Comparison, ComparisonSettings, compare
from cylinder_friction.evaluation.views import LearningCurve
from cylinder_friction.recordings.recording import Recording, RecordingMetadata

LABEL_PER_PASCAL = 1e-3
SETTINGS = ComparisonSettings(maximum_lag_s=0.05)


class OffsetEstimator(FrictionEstimator):
    """Friction is a thousandth of pressure 1, plus an offset [N] that is its whole error."""

    kind: ClassVar[str] = "offset_for_tests"

    def __init__(self, offset_n: float, noise_n: float = 0.0) -> None:
        super().__init__()
        self.offset_n = offset_n
        self.noise_n = noise_n

    def fit(self, recordings: Sequence[Recording]) -> Self:
        self._begin_fit(recordings)
        return self

    def new_state(self) -> None:
        return None

    def advance(self, state: None, samples: np.ndarray) -> np.ndarray:
        noise = self.noise_n * np.sin(1e6 * samples[:, 2])
        return LABEL_PER_PASCAL * samples[:, 0] + self.offset_n + noise

    def multiply_adds(self) -> int:
        return 2

    def _write(self, folder: Path) -> dict[str, Any]:
        return {"offset_n": self.offset_n, "noise_n": self.noise_n}

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        return cls(parameters["offset_n"], parameters["noise_n"])


def stroke(name: str, condition: str, level_n: float, rows: int = 2000) -> Recording:
    """Out and back at 0.1 m/s: friction +level while extending, -level while retracting."""
    phase = np.arange(rows) % 400
    direction = np.where(phase < 200, 1.0, -1.0)
    velocity = 0.1 * direction
    wobble = 1.0 + 0.1 * np.sin(0.05 * np.arange(rows))
    label = level_n * direction * wobble
    table = pd.DataFrame(
        {
            "time_s": 0.005 * np.arange(rows),
            "pressure_1_pa": label / LABEL_PER_PASCAL,
            "pressure_2_pa": np.full(rows, 1e5) + np.arange(rows),
            "position_m": 0.1 + np.cumsum(velocity) * 0.005,
            "velocity_m_s": velocity,
            "friction_n": label,
            "usable": np.arange(rows) >= 10,
        }
    )
    return Recording(RecordingMetadata(name, condition, f"s-{name}", 0.005, "made"), table)


@pytest.fixture(scope="session")
def strokes() -> list[Recording]:
    return [
        stroke(f"t{condition}_{take}", str(condition), 200.0 + 100.0 * condition)
        for condition in (1, 2, 3, 4)
        for take in (1, 2)
    ]


@pytest.fixture(scope="session")
def compared(strokes: list[Recording]) -> Callable[..., Comparison]:
    """Return a function: offsets [N] by estimator name (and true friction by recording) to a comparison."""

    def run(truth_n: dict[str, np.ndarray] | None = None, **offsets_n: float | tuple[float, float]) -> Comparison:
        estimators: dict[str, FrictionEstimator] = {}
        for name, offset in offsets_n.items():
            estimators[name] = OffsetEstimator(*offset) if isinstance(offset, tuple) else OffsetEstimator(offset)
            estimators[name].fit(strokes)
        return compare(estimators, strokes, SETTINGS, truth_n)

    return run


@pytest.fixture(scope="session")
def curves() -> dict[str, LearningCurve]:
    curve = LearningCurve((1, 2, 3), (30.0, 20.0, 15.0), (33.0, 25.0, 26.0), 2)
    return {"hybrid": curve, "paper_hybrid": curve}
