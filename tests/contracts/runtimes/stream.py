"""The compiled step in Python."""

from pathlib import Path

import numpy as np

from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream


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
