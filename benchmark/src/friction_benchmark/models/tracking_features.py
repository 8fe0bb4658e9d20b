"""Inputs of the learned gain: recent changes of the force balance relative to its noise, and the piston's motion.

Every change of the force balance is softly limited at tens of newtons, the size of its noise, whatever the rig's
friction: noise and friction then separate alike on a rig of 150 N and on one of 900 N, and training carries over.
"""

from collections.abc import Sequence

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.front_end import (
    CREEP_VELOCITY_M_S,
    FeatureRow,
    standardised,
    unscaled_front_end,
    with_history,
)
from cylinder_friction.estimators.linear import force_balance_taps
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals import causal
from friction_benchmark.evenly import evenly
from friction_benchmark.models.base import Single
from friction_benchmark.models.stroke_memory import MEMORY_NAMES, remember_strokes

SCALED_ON = 32  # Recordings that suffice to scale features, taken evenly from all
CHANGES = ((1, 3, 40.0), (2, 6, 30.0), (4, 12, 20.0), (8, 24, 15.0), (16, 64, 10.0))
"""Samples of the latest mean, samples of the mean before it that is subtracted, and the soft limit of the difference
[N]: the longer both, the smaller the remaining noise."""
SLOW_CREEP_M_S, ACCELERATION_M_S2, PRESSURE_RATE_PA_S, LOW_FORCE_N = 1e-3, 0.1, 1e5, 150.0


class TrackingFeatures:
    """Recordings to standardised features and the unfiltered force balance; causal.

    The usable rows of ``recordings`` scale the features; the memory of strokes is among them if ``strokes`` is true.
    """

    def __init__(
        self, cylinder: Cylinder, recordings: Sequence[Recording], inputs: Sequence[str], *, strokes: bool
    ) -> None:
        if tuple(inputs[:3]) != SAMPLE_COLUMNS:
            raise ValueError(f"expected inputs that begin with {', '.join(SAMPLE_COLUMNS)}, but got {tuple(inputs)}")
        sample_time_s = recordings[0].sample_time_s
        rows = tracking_rows(cylinder, sample_time_s, inputs)
        base = force_balance_taps(cylinder, inputs)
        front_end = with_history(unscaled_front_end(tuple(inputs), rows, base, sample_time_s))
        self.plan = standardised(front_end, evenly(recordings, SCALED_ON))
        self.strokes = strokes

    def of(self, recording: Recording) -> tuple[Single, Array]:
        """Return features, shape ``(n, k)``, and P1·A1 - P2·A2 [N], shape ``(n,)``."""
        samples = recording.samples(self.plan.inputs)
        features, balance_n = self.plan.run(samples)
        if not self.strokes:
            return features, balance_n
        place = self.plan.names.index("velocity_m_s")
        velocity = features[:, place].astype(np.float64) * self.plan.scale[place] + self.plan.mean[place]
        strokes = remember_strokes(velocity, balance_n, samples[:, 1])
        return np.concatenate([features, strokes.astype(np.float32)], axis=1), balance_n

    def multiply_adds(self) -> int:
        return self.plan.multiply_adds() + (3 * len(MEMORY_NAMES) if self.strokes else 0)


def tracking_rows(cylinder: Cylinder, sample_time_s: float, inputs: Sequence[str]) -> list[FeatureRow]:
    """Return the linear features, softly limited where they have a limit; of further inputs a moving average of 20."""
    first, second, position, *further = np.eye(len(inputs))[:, :, None]
    areas = force_balance_taps(cylinder, inputs)[0]
    average, fit = causal.moving_average_taps, causal.one_sided_savitzky_golay_taps
    velocity, acceleration = fit(21, 2, 1, sample_time_s), fit(31, 2, 2, sample_time_s)
    slow_velocity = causal.cascade_taps(average(20), causal.difference_taps(sample_time_s))
    rate = fit(15, 1, 1, sample_time_s)
    return [
        FeatureRow("velocity_m_s", position * velocity),
        FeatureRow("creep_velocity", position * velocity, CREEP_VELOCITY_M_S),
        FeatureRow("slow_creep_velocity", position * slow_velocity, CREEP_VELOCITY_M_S),
        FeatureRow("slowest_creep_velocity", position * slow_velocity, SLOW_CREEP_M_S),
        FeatureRow("acceleration", position * acceleration, ACCELERATION_M_S2),
        FeatureRow("pressure_1_pa", first * average(8)),
        FeatureRow("pressure_2_pa", second * average(8)),
        FeatureRow("force_balance_12_n", areas * average(12)),
        FeatureRow("low_force_balance_12", areas * average(12), LOW_FORCE_N),
        FeatureRow("pressure_1_rate", first * rate, PRESSURE_RATE_PA_S),
        FeatureRow("pressure_2_rate", second * rate, PRESSURE_RATE_PA_S),
        FeatureRow("position_m_20", position * average(20)),
        *(FeatureRow(f"{name}_20", one * average(20)) for name, one in zip(inputs[3:], further, strict=True)),
        *(
            FeatureRow(f"change_{short}_{long}", areas * np.concatenate([average(short), -average(long)]), limit_n)
            for short, long, limit_n in CHANGES
        ),
    ]
