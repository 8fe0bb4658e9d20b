"""Streams in Python: of any estimator, on the compiled step, and guarded for real time."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import isfinite
from sys import float_info
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.flags import Estimate
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.packed import new_state, packed_model
from cylinder_friction.realtime.sensor_offset import DEVIATION, OFFSET
from cylinder_friction.realtime.step import steps
from cylinder_friction.recordings.recording import refuse_not_finite

NO_OFFSET = "this estimator learns no sensor offset; expected no offset to start from; train it on recordings with one"


class EstimatorStream:
    """A running estimate of an estimator without a compiled step: samples go in one at a time, newtons come out.

    Args:
        new_state: Makes the state before the first sample.
        advance: Estimates friction [N] for the next samples and updates the state.
        inputs: Columns of a sample, in order.
    """

    def __init__(
        self, new_state: Callable[[], Any], advance: Callable[[Any, Array], Array], inputs: Sequence[str]
    ) -> None:
        self._new_state = new_state
        self._advance = advance
        self.inputs = tuple(inputs)
        self._state = new_state()

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self._state = self._new_state()

    def step(self, *sample: float) -> float:
        """Estimate friction [N] at this sample: one number per input, by default P1 [Pa], P2 [Pa], position [m].

        Raises:
            RecordingError: A value is NaN or infinite; the state stays as it was.
            TypeError: There are more or fewer numbers than inputs.
        """
        _refuse_other_length(sample, self.inputs)
        row = np.array([sample], dtype=np.float64)
        refuse_not_finite("stream", row, self.inputs)
        return float(self._advance(self._state, row)[0])


def _bound(*arguments: Any) -> Callable[[], Any]:
    """Bind the compiled step to its arguments, so that Numba does not inspect the arrays' types on each call."""
    steps(*arguments)  # compiles or loads it before time counts; NaN changes no state
    by_types = getattr(steps, "overloads", None)  # None in plain Python
    function = steps if by_types is None else by_types[tuple(map(numba.typeof, arguments))].entry_point
    return partial(function, *arguments)


def _room(rows: int) -> tuple[Array, Array, NDArray[np.int64]]:
    """Make the buffers that the compiled step fills: friction and bounds, offset, and flags."""
    return np.empty((rows, 3)), np.zeros((rows, 2)), np.empty(rows, dtype=np.int64)


class CompiledRun:
    """The guarded step with its state, over many samples at once; ``RealTimeStream`` takes them one by one.

    Use it to run recordings or requests with bounds and flags, from a fresh state or in pieces of any length. A sample
    costs a few microseconds. NaN and infinite values are flagged, never refused. One instance is for one thread.
    """

    def __init__(self, model: StepModel) -> None:
        self.inputs, self._tracker = model.inputs, model.offset
        self._packed = packed_model(model)
        self._state = new_state(self._packed, np.zeros(0) if model.offset is None else model.offset.new_state())

    def reset(self, offset_n: float = 0.0, uncertainty_n: float | None = None) -> None:
        """Forget everything; the next step is a first step.

        Args:
            offset_n: Offset of the sensors' zeros in friction, if known, for example from earlier in the session [N].
            uncertainty_n: Its standard uncertainty [N]; None: that of the sensors' stated zeros.

        Raises:
            ValueError: An offset is given, but this estimator learns none; or a number is impossible.
        """
        if self._tracker is None and (offset_n != 0.0 or uncertainty_n is not None):
            raise ValueError(NO_OFFSET)
        offset = self._state.offset if self._tracker is None else self._tracker.new_state(offset_n, uncertainty_n)
        kept: Any
        for kept, fresh in zip(self._state, new_state(self._packed, offset), strict=True):
            kept[...] = fresh

    @property
    def offset(self) -> tuple[float, float]:
        """Offset of the sensors' zeros in friction that the next step subtracts, and its standard uncertainty [N]."""
        state = self._state.offset
        return (0.0, 0.0) if self._tracker is None else (float(state[OFFSET]), float(state[DEVIATION]))

    def run(self, samples: Array) -> tuple[Array, NDArray[np.int64]]:
        """Step over samples, shape ``(n, inputs)``; return friction, lower and upper [N], ``(n, 3)``, and flags."""
        newtons, _, flags = self.run_with_offset(samples)
        return newtons, flags

    def run_with_offset(self, samples: Array) -> tuple[Array, Array, NDArray[np.int64]]:
        """Step over samples like ``run``; return ``offset`` after each sample too, ``(n, 2)``, before the flags."""
        samples = np.ascontiguousarray(samples, dtype=np.float64)
        filled = _room(len(samples))
        steps(self._packed, self._state, samples, *filled)
        return filled


class _CompiledStep(CompiledRun):
    """A ``CompiledRun`` that also takes one sample after the other."""

    def __init__(self, model: StepModel) -> None:
        super().__init__(model)
        row = np.full((1, len(model.inputs)), np.nan)
        self._sample = row[0]
        self._step = _bound(self._packed, self._state, row, *_room(1))

    def _take(self, sample: tuple[float, ...]) -> tuple[float, float, float, int]:
        _refuse_other_length(sample, self.inputs)
        for place, value in enumerate(sample):
            self._sample[place] = value
        taken: tuple[float, float, float, int] = self._step()
        return taken


class RealTimeStream(_CompiledStep):
    """A guarded running estimate for a control loop: it accepts any reading, and flags how far to trust the estimate.

    An input that is not finite, or that no working sensor would give, is held at its last valid value and flagged; it
    never reaches the state. A sample holds readings as the sensors give them: the step applies the signs and offsets
    that the mapping of training stated. To run a recording, give its ``readings``. Streams are independent, but each is
    for one thread.

    Args:
        model: From an estimator's ``step_model``.

    Example:
        >>> stream = hybrid.real_time()
        >>> samples = test[0].samples()
        >>> stream.warm_up(*samples[0])  # the cylinder has stood here for a while
        >>> stream.step(*samples[0]).flags & 1  # NOT_READY is not set any more
        0
    """

    def __init__(self, model: StepModel) -> None:
        super().__init__(model)
        self.model = model

    def step(self, *sample: float) -> Estimate:
        """Estimate friction with bounds [N] and flags (see ``Flag``) at this sample, one number per input."""
        return Estimate(*self._take(sample))

    def warm_up(self, *sample: float, steps: int | None = None) -> None:
        """Reset, then repeat one sample until the state has settled on it.

        Args:
            sample: The present sample.
            steps: Number of steps; None: the guard's ``warm_up_samples``, after which ``WARMING`` is over.
        """
        self.reset()
        for _ in range(self.model.guard.warm_up_samples if steps is None else steps):
            self._take(sample)


class StrictStream(_CompiledStep):
    """An estimator's ``stream()`` on the compiled step: equal to ``estimate`` bit for bit; refuses NaN and infinity.

    Use it to replay recordings sample by sample: it takes their columns, which are corrected. In a machine a sensor may
    fail and its readings are not corrected: use ``RealTimeStream`` there. ``step``
    raises ``RecordingError`` for a value that is not finite, and ``TypeError`` for a wrong number of values.

    Example:
        >>> stream = hybrid.stream()
        >>> stream.step(*test[0].samples()[0]) == float(hybrid.estimate(test[0])[0])
        True
    """

    def __init__(self, model: StepModel) -> None:
        largest = (float_info.max,) * len(model.inputs)
        smallest = tuple(-value for value in largest)
        guard = replace(model.guard, accept_lower=smallest, accept_upper=largest)
        super().__init__(replace(model.for_recordings(), guard=guard))

    def step(self, *sample: float) -> float:
        """Return friction [N] at this sample; see ``EstimatorStream.step``."""
        if len(sample) != len(self.inputs) or not all(map(isfinite, sample)):
            _refuse_other_length(sample, self.inputs)
            refuse_not_finite("stream", np.array([sample], dtype=np.float64), self.inputs)
        return self._take(sample)[0]


def _refuse_other_length(sample: tuple[float, ...], inputs: tuple[str, ...]) -> None:
    if len(sample) == 1 and isinstance(sample[0], list | tuple | np.ndarray):
        kind = type(sample[0]).__name__
        raise TypeError(f"got one {kind}, but expected {', '.join(inputs)}; give its numbers one by one: step(*sample)")
    if len(sample) != len(inputs):
        raise TypeError(f"expected {len(inputs)} numbers, {', '.join(inputs)}, but got {len(sample)}")
