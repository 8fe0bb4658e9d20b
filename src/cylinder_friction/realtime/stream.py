"""Running estimates in Python on the compiled step: guarded for real time, or strict as every estimator's stream."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import isfinite, nan
from sys import float_info
from typing import TYPE_CHECKING, Any

import numpy as np

from cylinder_friction.estimators.base import EstimatorStream
from cylinder_friction.realtime.flags import Estimate
from cylinder_friction.realtime.packed import PackedModel, PackedState
from cylinder_friction.realtime.step import step, steps
from cylinder_friction.recordings.recording import refuse_not_finite

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from cylinder_friction.realtime.model import StepModel

    Array = NDArray[np.float64]

_STEP: Callable[..., Any] = step


class RealTimeStream:
    """One running estimate, guarded: takes whatever the sensors give, and says how far the estimate can be trusted.

    A channel that is not finite, or that no working sensor would give, is held at its last valid value and flagged; it
    never reaches the state. Streams do not touch each other, but one stream is for one thread.

    Args:
        model: From ``step_model``.
    """

    def __init__(self, model: StepModel) -> None:
        self.model = model
        self._packed = PackedModel.of(model)
        self._state = PackedState.of(self._packed)
        self._step: Callable[..., Any] = partial(_STEP, *self._packed.arrays(), *self._state.arrays())
        self._step(nan, nan, nan)  # compiled, or loaded, before time counts; touches no state

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> Estimate:
        """Return the estimate at this sample: friction, bounds [N] and flags (see ``Flag``)."""
        return Estimate(*self._step(float(pressure_1_pa), float(pressure_2_pa), float(position_m)))

    def reset(self) -> None:
        """Forget everything; the next step is a first step."""
        self._state.reset()

    def warm_up(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float, steps: int | None = None) -> None:
        """Reset, then steps on one and the same sample, so that the state comes to rest at it.

        Args:
            pressure_1_pa, pressure_2_pa, position_m: Where the cylinder stands now.
            steps: How often; None for the guard's ``warm_up_samples``, after which ``WARMING`` is over.
        """
        self.reset()
        for _ in range(self.model.guard.warm_up_samples if steps is None else steps):
            self._step(float(pressure_1_pa), float(pressure_2_pa), float(position_m))

    def run(self, samples: Array) -> tuple[Array, NDArray[np.int64]]:
        """Step over samples, shape ``(n, 3)``; returns friction, lower and upper [N], shape ``(n, 3)``, and flags."""
        samples = np.ascontiguousarray(samples, dtype=np.float64)
        newtons, flags = np.empty((len(samples), 3)), np.empty(len(samples), dtype=np.int64)
        steps(self._packed.arrays(), self._state.arrays(), samples, newtons, flags)
        return newtons, flags


class StrictStream(EstimatorStream):
    """An estimator's ``stream()`` on the compiled step: equal to ``estimate`` bit for bit; refuses NaN and infinity."""

    def __init__(self, model: StepModel) -> None:
        every, none = (-float_info.max,) * 3, (float_info.max,) * 3
        packed = PackedModel.of(replace(model, guard=replace(model.guard, accept_lower=every, accept_upper=none)))
        self._packed_state = PackedState.of(packed)
        self._step: Callable[..., Any] = partial(_STEP, *packed.arrays(), *self._packed_state.arrays())
        self._step(nan, nan, nan)  # compiled, or loaded, before time counts; touches no state

    def reset(self) -> None:
        self._packed_state.reset()

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:  # type: ignore[override]
        if not (isfinite(pressure_1_pa) and isfinite(pressure_2_pa) and isfinite(position_m)):
            refuse_not_finite("stream", np.array([[pressure_1_pa, pressure_2_pa, position_m]], dtype=np.float64))
        return self._step(float(pressure_1_pa), float(pressure_2_pa), float(position_m))[0]
