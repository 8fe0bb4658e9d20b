"""Inputs of the learned gain: recent changes of the force balance relative to its noise, and the piston's motion.

Every change of the force balance is softly limited at tens of newtons, the size of its noise, whatever the rig's
friction: noise and friction then separate alike on a rig of 150 N and on one of 900 N, and training carries over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cylinder_friction.estimators.front_end import (
    CREEP_VELOCITY_M_S,
    FeatureRow,
    FrontEnd,
    FrontEndBlock,
    FrontEndState,
    standardised,
    unscaled_front_end,
    with_history,
)
from cylinder_friction.estimators.linear import force_balance_taps
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.signals.causal import (
    cascade_taps,
    difference_taps,
    moving_average_taps,
    one_sided_savitzky_golay_taps,
)
from friction_benchmark.evenly import evenly
from friction_benchmark.models.stroke_memory import MEMORY_NAMES, new_stroke_memory, remember_strokes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

PRESSURE_1, PRESSURE_2, POSITION = range(3)
SCALED_ON = 32
"""Recordings that suffice to scale features, taken evenly from all."""
CHANGES = ((1, 3, 40.0), (2, 6, 30.0), (4, 12, 20.0), (8, 24, 15.0), (16, 64, 10.0))
"""Samples of the latest mean, samples of the mean before it that is subtracted, and the soft limit of the difference
[N]: the longer both, the smaller the remaining noise."""
SLOW_CREEP_M_S, ACCELERATION_M_S2, PRESSURE_RATE_PA_S, LOW_FORCE_N = 1e-3, 0.1, 1e5, 150.0


@dataclass
class TrackingState:
    """State of the filters, of the history of the motion, and of the strokes so far."""

    features: FrontEndState
    strokes: Array


class TrackingFeatures:
    """Raw samples to standardised features and the unfiltered force balance; causal, and independent of cutting.

    Args:
        plan: Of filters and history.
        strokes: Whether the memory of strokes is among the features.
    """

    def __init__(self, plan: FrontEnd, *, strokes: bool) -> None:
        self.plan, self.strokes = plan, strokes
        self._block = FrontEndBlock(plan)
        self._velocity = plan.names.index("velocity_m_s")

    @property
    def names(self) -> tuple[str, ...]:
        return self.plan.names + (MEMORY_NAMES if self.strokes else ())

    @classmethod
    def of(cls, cylinder: Cylinder, recordings: Sequence[Recording], inputs: Sequence[str], *, strokes: bool) -> Self:
        """Return the features, scaled by the usable rows of these recordings.

        Raises:
            ValueError: The first three inputs are not both raw pressures and the position.
        """
        if tuple(inputs[:3]) != SAMPLE_COLUMNS:
            raise ValueError(f"expected inputs that begin with {', '.join(SAMPLE_COLUMNS)}, but got {tuple(inputs)}")
        sample_time_s = recordings[0].sample_time_s
        rows = tracking_rows(cylinder, sample_time_s, inputs)
        base = force_balance_taps(cylinder, inputs)
        front_end = with_history(unscaled_front_end(tuple(inputs), rows, base, sample_time_s))
        scaled = standardised(front_end, FrontEndBlock(front_end), evenly(recordings, SCALED_ON))
        return cls(scaled, strokes=strokes)

    def new_state(self) -> TrackingState:
        return TrackingState(self._block.new_state(), new_stroke_memory())

    def advance(self, state: TrackingState, samples: Array) -> tuple[NDArray[np.float32], Array]:
        """Return features, shape ``(n, k)``, float32, and P1·A1 - P2·A2 [N], shape ``(n,)``."""
        features, balance_n = self._block.advance(state.features, samples)
        if not self.strokes:
            return features, balance_n
        front_end = self.plan
        velocity = features[:, self._velocity].astype(np.float64)
        velocity = velocity * front_end.scale[self._velocity] + front_end.mean[self._velocity]
        pressure_2_pa = np.ascontiguousarray(samples[:, PRESSURE_2])
        strokes = remember_strokes(velocity, balance_n, pressure_2_pa, state.strokes)
        return np.concatenate([features, strokes.astype(np.float32)], axis=1), balance_n

    def multiply_adds(self) -> int:
        return self._block.multiply_adds() + (3 * len(MEMORY_NAMES) if self.strokes else 0)

    def to_dict(self) -> dict[str, Any]:
        return {**self.plan.to_dict(), "strokes": self.strokes}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        return cls(FrontEnd.from_dict(content), strokes=content["strokes"])


def tracking_rows(cylinder: Cylinder, sample_time_s: float, inputs: Sequence[str] = SAMPLE_COLUMNS) -> list[FeatureRow]:
    """Return the linear features, softly limited where they have a limit; of further inputs a moving average of 20."""
    count = len(inputs)
    areas = np.zeros((count, 1))
    areas[:3] = force_balance_taps(cylinder)[0]
    average, step = moving_average_taps, difference_taps(sample_time_s)
    velocity = one_sided_savitzky_golay_taps(21, 2, 1, sample_time_s)
    slow_velocity = cascade_taps(average(20), step)
    rate = one_sided_savitzky_golay_taps(15, 1, 1, sample_time_s)
    acceleration = one_sided_savitzky_golay_taps(31, 2, 2, sample_time_s)
    rows = [
        FeatureRow("velocity_m_s", _signal(POSITION, velocity, count)),
        FeatureRow("creep_velocity", _signal(POSITION, velocity, count), CREEP_VELOCITY_M_S),
        FeatureRow("slow_creep_velocity", _signal(POSITION, slow_velocity, count), CREEP_VELOCITY_M_S),
        FeatureRow("slowest_creep_velocity", _signal(POSITION, slow_velocity, count), SLOW_CREEP_M_S),
        FeatureRow("acceleration", _signal(POSITION, acceleration, count), ACCELERATION_M_S2),
        FeatureRow("pressure_1_pa", _signal(PRESSURE_1, average(8), count)),
        FeatureRow("pressure_2_pa", _signal(PRESSURE_2, average(8), count)),
        FeatureRow("force_balance_12_n", areas * average(12)),
        FeatureRow("low_force_balance_12", areas * average(12), LOW_FORCE_N),
        FeatureRow("pressure_1_rate", _signal(PRESSURE_1, rate, count), PRESSURE_RATE_PA_S),
        FeatureRow("pressure_2_rate", _signal(PRESSURE_2, rate, count), PRESSURE_RATE_PA_S),
    ]
    for name, column in [("position_m", POSITION), *((inputs[more], more) for more in range(3, count))]:
        rows.append(FeatureRow(f"{name}_20", _signal(column, average(20), count)))
    for short, long, limit_n in CHANGES:
        taps = np.concatenate([average(short), -average(long)])
        rows.append(FeatureRow(f"change_{short}_{long}", areas * taps, limit_n))
    return rows


def _signal(column: int, taps: Array, count: int) -> Array:
    result = np.zeros((count, len(taps)))
    result[column] = taps
    return result
