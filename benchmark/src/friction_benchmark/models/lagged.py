"""The past of the features, for models without memory of their own: earlier rows, and slow averages."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from friction_benchmark.models.base import Single


@dataclass(frozen=True)
class Past:
    """Features now, some samples ago, and averaged over some time; causal.

    Before the first row every lag repeats that row. Averages begin at zero, the features' mean, because one row is a
    poor estimate of a mean.
    """

    lags: tuple[int, ...]  # How many samples ago, each at least 1
    averages: tuple[float, ...]  # Time constants of first-order averages, in samples, each at least 1

    def width(self, features: int) -> int:
        """Return how many columns ``of`` gives for so many features."""
        return features * (1 + len(self.lags) + len(self.averages))

    def of(self, features: Single) -> Single:
        """Return features, lagged and averaged ones side by side, shape ``(n, width(k))``, float32."""
        rows = np.arange(len(features))
        parts = [features, *(features[np.maximum(rows - lag, 0)] for lag in self.lags)]
        weights = (1.0 / average for average in self.averages)
        parts += [lfilter([each], [1.0, each - 1.0], features, axis=0).astype(np.float32) for each in weights]
        return np.concatenate(parts, axis=1)

    def multiply_adds(self, features: int) -> int:
        return len(self.averages) * features
