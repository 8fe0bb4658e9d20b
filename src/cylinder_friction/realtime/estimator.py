"""Estimators that are one ``StepModel``: their streams run the compiled step."""

from __future__ import annotations

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.realtime.from_hybrid import step_model
from cylinder_friction.realtime.stream import RealTimeStream, StrictStream


class RealTimeEstimator(FrictionEstimator):
    """An estimator that ``step_model`` knows."""

    def stream(self) -> StrictStream:
        """Return a fresh stream on the compiled step; equal to ``estimate`` bit for bit."""
        return StrictStream(step_model(self))

    def real_time(self) -> RealTimeStream:
        """Return a fresh guarded stream, which takes whatever the sensors give; see ``RealTimeStream``."""
        return RealTimeStream(step_model(self))
