"""Recordings whose pressures are noisier than they were."""

import numpy as np

from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.recordings.recording import Recording


def with_noise(recording: Recording, noise_pa: float) -> Recording:
    """Return a recording with white noise of this standard deviation [Pa] added to both pressures."""
    noise = np.random.default_rng(1).normal(0.0, noise_pa, (len(PRESSURES), len(recording)))
    return recording.with_columns(
        **{name: recording.column(name) + own for name, own in zip(PRESSURES, noise, strict=True)}
    )
