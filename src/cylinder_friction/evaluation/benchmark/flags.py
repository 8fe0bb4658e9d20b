"""Where an estimate goes beyond what its estimator was taught on: any input, or the speed, outside the taught range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.realtime.bounds import velocity_taps
from cylinder_friction.signals.causal import FirFilter

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from cylinder_friction.evaluation.bootstrap import Array, Mask
    from cylinder_friction.recordings import Recording

MARGIN = 0.05
"""Share of its span by which a taught range is widened, as in real time."""


@dataclass(frozen=True, eq=False)
class TaughtRange:
    """Smallest and largest value of each input, and of the velocity [m/s] last; shape ``(inputs + 1,)`` each."""

    inputs: tuple[str, ...]
    lower: Array
    upper: Array

    @classmethod
    def of(
        cls, recordings: Sequence[Recording], inputs: tuple[str, ...], velocity: Callable[[Recording], Array]
    ) -> TaughtRange:
        """Returns the range of these recordings, widened by ``MARGIN`` of itself.

        Args:
            recordings: What was taught.
            inputs: Columns that count.
            velocity: Returns the velocity through a recording [m/s], shape ``(n,)``.
        """
        values = [_values(recording, inputs, velocity) for recording in recordings]
        lower = np.min([each.min(axis=0) for each in values], axis=0)
        upper = np.max([each.max(axis=0) for each in values], axis=0)
        slack = MARGIN * (upper - lower)
        return cls(inputs, lower - slack, upper + slack)

    def leaves(self, recording: Recording, velocity: Callable[[Recording], Array]) -> Mask:
        """Returns which rows of a recording lie outside, shape ``(n,)``."""
        values = _values(recording, self.inputs, velocity)
        return np.asarray(((values < self.lower) | (values > self.upper)).any(axis=1))


def causal_velocity(recording: Recording) -> Array:
    """Returns the velocity that a flag goes by, from samples until now [m/s], shape ``(n,)``."""
    block = FirFilter(velocity_taps(recording.sample_time_s)[None, 2:3])
    return block.advance(block.new_state(), recording.samples(("position_m",)))[:, 0]


def offline_velocity(recording: Recording) -> Array:
    """Returns the velocity from the off-line filter [m/s], shape ``(n,)``."""
    return recording.column("velocity_m_s")


def _values(recording: Recording, inputs: tuple[str, ...], velocity: Callable[[Recording], Array]) -> Array:
    return np.column_stack([recording.samples(inputs), velocity(recording)])
