"""The compiled step in Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.realtime.stream import RealTimeStream

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.realtime.model import StepModel


class _Rows(RealTimeStream):
    def run(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        outputs = [self.step(*sample) for sample in samples]
        return np.array([output[:3] for output in outputs]), np.array([output.flags for output in outputs])


class Steps:
    """One call per sample."""

    name = "python"

    def open(self, model: StepModel, folder: Path) -> RealTimeStream:
        return _Rows(model)


class Run:
    """One call for all samples."""

    name = "python_run"

    def open(self, model: StepModel, folder: Path) -> RealTimeStream:
        return RealTimeStream(model)


RUNTIMES = [Steps(), Run()]
